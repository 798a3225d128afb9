"""Pictures of meshes and fields: surfaces, lines, arrows, colour bar, legend, axes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.plot.camera import DEFAULT_VIEW, Camera, FloatArray, Frame, fit, look_from
from gibiane_ops.kernels.plot.canvas import INK, MUTED, header, sheet
from gibiane_ops.kernels.plot.image import FINER, render
from gibiane_ops.kernels.plot.layers import Arrows, Dots, Labels, Layer, Lines, Surface, placed, used
from gibiane_ops.kernels.plot.raster import BoolArray, visible_runs
from gibiane_ops.kernels.plot.scales import Bands, Scale, bands_for, bar_labels, short

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEADER, FOOTER, SIDE = 0.11, 0.06, 0.185
"""Parts of the sheet kept for the title, the legend, and the colour bar."""


def draw_scene(
    path: Path | str,
    layers: Sequence[Layer],
    *,
    view: tuple[float, float, float] | FloatArray | None = None,
    scale: Scale | None = None,
    title: str = "",
    caption: str = "",
    size: tuple[int, int] = (1200, 900),
    by_vtk: bool = False,
) -> None:
    """Draw meshes and fields into a file.

    Parameters
    ----------
    path : Path or str
        Extension .png, .svg or .pdf; missing folders are made.
    layers : sequence of Surface, Lines, Dots, Arrows or Labels
        Lines, dots and arrows are drawn over the surfaces in this order; surfaces hide one another as in space.
        When all points have two coordinates the picture is plane, with graduated axes; so is that of points of one
        height seen from above.
    view : (3,) float64, optional
        From the object to the eye; by default from the front (-y), the right (+x) and above (+z). Ignored in the plane.
    scale : Scale, optional
        Colours of the values of the surfaces that have some.
    title, caption : str
        Text at the top, and the smaller line below it.
    size : (int, int)
        Width and height in pixels.
    by_vtk : bool
        Let VTK draw the surfaces of a picture in space; only where `vtk_image.obstacle` finds none.

    Raises
    ------
    BadValue
        When there is nothing to draw, a coordinate is not finite, the view has no direction, the field has no finite
        value, or the extension is unknown.
    MissingPackage
        When matplotlib is not installed.

    Notes
    -----
    Orthographic projection; surfaces are rendered with a depth buffer, so that hidden parts are exact, and put as an
    image under the lines and texts, which stay vectors in .svg and .pdf.

    Cost
    ----
    About a second.
    """
    layers = [layer for layer in layers if len(used(layer))]
    if not layers:
        raise BadValue("picture", "without a point", "at least one point or facet")
    plane = all(layer.points.shape[1] == 2 for layer in layers) or _seen_flat(layers, view)
    direction = np.asarray((0.0, 0.0, 1.0) if plane else DEFAULT_VIEW if view is None else view, np.float64)
    if not np.isfinite(direction).all() or not direction.any():
        raise BadValue("direction of the view", direction.tolist(), "a finite vector that is not zero")
    camera = look_from(direction)
    with sheet(path, size) as figure:
        surfaces = [layer for layer in layers if isinstance(layer, Surface)]
        bands = bands_of(surfaces, scale or Scale())
        header(figure, title, caption)
        labels = [layer for layer in layers if layer.label]
        axes, width, height = _main_axes(figure, size, plane=plane, bar=bands is not None, foot=bool(labels))
        spans = [camera.project(placed(layer)[used(layer)]) for layer in layers]
        diagonal = float(np.linalg.norm(np.ptp(np.concatenate(spans), axis=0))) or 1.0
        factors = {id(layer): arrow_factor(layer, diagonal) for layer in layers if isinstance(layer, Arrows)}
        spans += [camera.project(_tips(a, factors[id(a)])) for a in layers if isinstance(a, Arrows)]
        frame = fit(np.concatenate(spans), width, height)
        axes.set(xlim=frame.extent[:2], ylim=frame.extent[2:])
        if plane:
            _graduate(axes, np.concatenate(spans))
        if by_vtk and surfaces and not plane:
            from gibiane_ops.kernels.plot import vtk_image

            image, depth = vtk_image.render(surfaces, camera, frame, bands)
        else:
            image, depth = render(surfaces, camera, frame, bands)
        if surfaces:
            axes.imshow(image, origin="lower", extent=frame.extent, interpolation="nearest", aspect="auto", zorder=1.0)
        for order, layer in enumerate(layers):
            match layer:
                case Lines():
                    _draw_lines(axes, layer, camera, frame, depth, 0.004 * diagonal, 2.0 + order)
                case Dots():
                    xy = camera.project(placed(layer))
                    axes.plot(
                        xy[:, 0],
                        xy[:, 1],
                        "o",
                        ms=layer.size,
                        mfc=layer.color,
                        mec="white",
                        mew=0.4,
                        zorder=2.0 + order,
                    )
                case Arrows():
                    shown = _in_sight(layer, factors[id(layer)], camera, frame, depth, 0.004 * diagonal)
                    _draw_arrows(axes, layer, camera, factors[id(layer)], shown, 2.0 + order)
                case Labels():
                    _draw_texts(axes, layer, camera, frame, depth, 0.004 * diagonal, 2.0 + order)
                case Surface():
                    pass
        if bands is not None:
            _draw_bar(figure, bands, scale or Scale())
        if not plane:
            _draw_triad(figure, camera, size)
        if labels:
            _draw_legend(figure, labels, factors, left=0.03 if plane else 0.16)


def bands_of(surfaces: Sequence[Surface], scale: Scale) -> Bands | None:
    """Choose the bands for all the values that are seen, or none."""
    seen = [np.asarray(s.nodal, np.float64)[used(s)] for s in surfaces if s.nodal is not None]
    seen += [np.asarray(s.flat, np.float64) for s in surfaces if s.nodal is None and s.flat is not None]
    return bands_for(scale, np.concatenate(seen)) if seen else None


def _main_axes(figure: Figure, size: tuple[int, int], *, plane: bool, bar: bool, foot: bool) -> tuple[Axes, int, int]:
    """Place the axes of the object on whole pixels; give them with their width and height in pixels."""
    left = 0.09 if plane else 0.02
    right = 1.0 - (SIDE if bar else 0.03)
    bottom = (0.07 if plane else 0.04) + (FOOTER if foot else 0.0)
    width, height = (int(size[0] * (right - left)), int(size[1] * (1.0 - HEADER - bottom)))
    corner = int(size[0] * left), int(size[1] * bottom)
    axes = figure.add_axes((corner[0] / size[0], corner[1] / size[1], width / size[0], height / size[1]))
    axes.set_facecolor("none")
    if plane:
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8, length=3)
    else:
        axes.set_axis_off()
    return axes, width, height


def _seen_flat(layers: Sequence[Layer], view: tuple[float, float, float] | FloatArray | None) -> bool:
    """Whether points of one height are seen from straight above."""
    if view is None or not float(np.hypot(view[0], view[1])) <= 1e-3 * float(view[2]):
        return False
    if any(layer.points.shape[1] != 3 for layer in layers):
        return False
    heights = np.concatenate([placed(layer)[used(layer), 2] for layer in layers])
    return float(np.ptp(heights)) == 0.0


def _graduate(axes: Axes, seen: FloatArray) -> None:
    """Draw graduated axes along the object only, not along the empty part of the sheet."""
    (left, bottom), (right, top) = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    gap = 0.02 * max(right - left, top - bottom)
    axes.spines["bottom"].set_position(("data", bottom - gap))
    axes.spines["left"].set_position(("data", left - gap))
    for axis, spine, low, high in (
        (axes.xaxis, axes.spines["bottom"], left, right),
        (axes.yaxis, axes.spines["left"], bottom, top),
    ):
        ticks = np.asarray(axis.get_ticklocs())
        slack = 1e-9 * max(high - low, 1e-300)
        axis.set_ticks(ticks[(ticks >= low - slack) & (ticks <= high + slack)])
        spine.set_bounds(low, high)


def _draw_lines(
    axes: Axes, layer: Lines, camera: Camera, frame: Frame, depth: FloatArray, slack: float, order: float
) -> None:
    from matplotlib.collections import LineCollection

    screen = camera.project(placed(layer))
    ends = screen[np.asarray(layer.cells, np.int64)]
    segments = ends[..., :2]
    if not layer.on_top:
        fine = frame.finer(FINER)
        start, end = (np.column_stack([fine.pixels(ends[:, k]), ends[:, k, 2]]) for k in (0, 1))
        first, last = visible_runs(start, end, depth, slack)
        corner = np.array([fine.left, fine.bottom])
        segments = np.stack([first, last], axis=1) * fine.pixel + corner
    axes.add_collection(
        LineCollection(
            list(segments),
            colors=layer.color,
            linewidths=layer.width,
            linestyles=layer.style,
            capstyle="round",
            zorder=order,
        ),
        autolim=False,
    )


def arrow_factor(layer: Arrows, diagonal: float) -> float:
    """Length in the picture of a vector of length one."""
    largest = float(np.max(np.linalg.norm(layer.vectors, axis=1), initial=0.0))
    return layer.longest * diagonal / largest if largest > 0.0 else 0.0


def _tips(layer: Arrows, factor: float) -> FloatArray:
    ends = Arrows(layer.points + factor * layer.vectors, layer.vectors, offset=layer.offset)
    return placed(ends)


def _in_sight(layer: Arrows, factor: float, camera: Camera, frame: Frame, depth: FloatArray, slack: float) -> BoolArray:
    """Say which arrows have an end that no surface hides: those wholly inside a solid would only darken it."""
    ends = [camera.project(placed(layer)), camera.project(_tips(layer, factor))]
    return _seen(ends[0], frame, depth, slack) | _seen(ends[1], frame, depth, slack)


def _seen(screen: FloatArray, frame: Frame, depth: FloatArray, slack: float) -> BoolArray:
    """Say which points no surface hides."""
    column, row = np.floor(frame.finer(FINER).pixels(screen)).astype(np.int64).T
    inside = (column >= 0) & (row >= 0) & (column < depth.shape[1]) & (row < depth.shape[0])
    nearest = np.full(len(screen), -np.inf)
    nearest[inside] = depth[row[inside], column[inside]]
    seen: BoolArray = screen[:, 2] >= nearest - slack
    return seen


def _draw_texts(
    axes: Axes, layer: Labels, camera: Camera, frame: Frame, depth: FloatArray, slack: float, order: float
) -> None:
    from matplotlib.patheffects import withStroke

    screen = camera.project(placed(layer))
    away = (2.5, 2.0) if layer.aside else (0.0, 0.0)
    at = ("left", "bottom") if layer.aside else ("center", "center")
    for i in np.flatnonzero(_seen(screen, frame, depth, slack)).tolist():
        axes.annotate(
            layer.texts[i],
            (screen[i, 0], screen[i, 1]),
            away,
            textcoords="offset points",
            ha=at[0],
            va=at[1],
            fontsize=layer.size,
            color=layer.color,
            path_effects=[withStroke(linewidth=1.4, foreground="white")],
            zorder=order,
            annotation_clip=False,
        )


def _draw_arrows(axes: Axes, layer: Arrows, camera: Camera, factor: float, in_sight: BoolArray, order: float) -> None:
    from matplotlib.patheffects import withStroke

    start, tip = camera.project(placed(layer)), camera.project(_tips(layer, factor))
    along = tip - start
    shown = in_sight & (np.hypot(along[:, 0], along[:, 1]) > 0.0)
    axes.quiver(
        start[shown, 0],
        start[shown, 1],
        along[shown, 0],
        along[shown, 1],
        angles="xy",
        scale_units="xy",
        scale=1.0,
        units="dots",
        width=2.0,
        headwidth=4.5,
        headlength=5.5,
        headaxislength=5.0,
        minlength=0.5,
        color=layer.color,
        path_effects=[withStroke(linewidth=1.1, foreground="white")],
        zorder=order,
    )


def _draw_bar(figure: Figure, bands: Bands, scale: Scale) -> None:
    """Draw the colour bar with its title above, and the extreme values below."""
    from textwrap import wrap

    left, bottom, height = 1.0 - SIDE + 0.02, 0.19, 0.56
    axes = figure.add_axes((left, bottom, 0.022, height))
    n = len(bands.colors)
    axes.imshow(bands.colors[:, None, :], origin="lower", extent=(0.0, 1.0, 0.0, n), aspect="auto")
    axes.set_xticks([])
    every = -(-(n + 1) // 16)
    axes.set_yticks(np.arange(0, n + 1, every), bar_labels(bands.limits)[::every])
    axes.yaxis.tick_right()
    axes.tick_params(axis="y", labelsize=8.5, length=2.5, pad=3)
    text = "\n".join(line for part in scale.title.split("\n") for line in wrap(part, 18))
    figure.text(left, bottom + height + 0.025, text, fontsize=9, fontweight="bold", va="bottom", linespacing=1.15)
    extremes = f"max  {short(bands.high, 4)}\nmin  {short(bands.low, 4)}"
    figure.text(left, bottom - 0.03, extremes, fontsize=8.5, va="top", color=INK, linespacing=1.5)


def _draw_triad(figure: Figure, camera: Camera, size: tuple[int, int]) -> None:
    """Draw the three axes of space at the lower left."""
    side = 130.0
    axes = figure.add_axes((0.015, 0.015, side / size[0], side / size[1]))
    axes.set_axis_off()
    axes.set(xlim=(-1.35, 1.35), ylim=(-1.35, 1.35))
    for k in np.argsort(camera.axes[2]):  # the axis that points at the eye last
        x, y = camera.axes[0, k], camera.axes[1, k]
        color = ("#c0392b", "#2e8b57", "#2f5fb3")[k]
        reach = float(np.hypot(x, y))
        if reach < 0.05:
            axes.plot(0.0, 0.0, "o", ms=4, color=color)
            axes.text(-0.35, -0.35, "xyz"[k], color=color, fontsize=9, ha="center", va="center")
            continue
        axes.annotate(
            "",
            xy=(x, y),
            xytext=(0.0, 0.0),
            arrowprops={
                "arrowstyle": "-|>,head_length=0.35,head_width=0.16",
                "color": color,
                "lw": 1.4,
                "shrinkA": 0.0,
                "shrinkB": 0.0,
            },
        )
        beyond = 1.0 + 0.26 / reach
        axes.text(x * beyond, y * beyond, "xyz"[k], color=color, fontsize=9, ha="center", va="center")


def _draw_legend(figure: Figure, labels: Sequence[Layer], factors: dict[int, float], left: float) -> None:
    """Name the layers in one line at the foot."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = []
    for layer in labels:
        match layer:
            case Surface():
                plain = layer.nodal is None and layer.flat is None
                fill = layer.color if plain else "none"
                handles.append(Patch(fc=fill, ec=MUTED, lw=0.6, alpha=layer.alpha, label=layer.label))
            case Lines():
                handles.append(Line2D([], [], color=layer.color, lw=layer.width, ls=layer.style, label=layer.label))
            case Dots():
                handles.append(Line2D([], [], color=layer.color, marker="o", ms=layer.size, ls="", label=layer.label))
            case Arrows():
                largest = float(np.max(np.linalg.norm(layer.vectors, axis=1), initial=0.0))
                text = f"{layer.label} (longest {short(largest, 3)})"
                handles.append(Line2D([], [], color=layer.color, marker=r"$\rightarrow$", ms=13, ls="", label=text))
            case Labels():
                handles.append(Line2D([], [], color=layer.color, marker="$n$", ms=7, ls="", label=layer.label))
    figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(left, 0.02),
        ncols=min(len(handles), 4),
        fontsize=9,
        handlelength=1.5,
        columnspacing=1.8,
        borderaxespad=0.0,
    )
