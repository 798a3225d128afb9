"""Windows on a screen: a scene that is turned with the mouse, or a picture."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gibiane_ops.kernels.plot import vtk_image
from gibiane_ops.kernels.plot.camera import DEFAULT_VIEW, FloatArray, fit, look_from
from gibiane_ops.kernels.plot.layers import Arrows, Dots, Labels, Layer, Lines, Surface, placed, used
from gibiane_ops.kernels.plot.scales import Bands, Scale, bar_labels
from gibiane_ops.kernels.plot.scene import arrow_factor, bands_of

SIZE = (1200, 900)


def screen_exists() -> bool:
    """Tell whether windows can be opened: there is a screen, it answers, and PyVista is there to draw on it."""
    if vtk_image.obstacle() is not None:
        return False
    if sys.platform != "linux":
        return True
    if not os.environ.get("DISPLAY"):
        return False
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return False
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XOpenDisplay.argtypes = [ctypes.c_char_p]
    x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
    # VTK would end the process on a screen that does not answer
    display = x11.XOpenDisplay(None)
    if display:
        x11.XCloseDisplay(display)
    return bool(display)


def show_scene(
    layers: Sequence[Layer],
    *,
    view: tuple[float, float, float] | FloatArray | None = None,
    scale: Scale | None = None,
    title: str = "",
    seconds: float | None = None,
) -> None:
    """Show a scene in space until its window is closed.

    Parameters
    ----------
    layers, view, scale, title
        As for `draw_scene`.
    seconds : float, optional
        Close by itself after so long.
    """
    import pyvista

    layers = [layer for layer in layers if len(used(layer))]
    camera = look_from(np.asarray(DEFAULT_VIEW if view is None else view, np.float64))
    everything = np.concatenate([placed(layer)[used(layer)] for layer in layers])
    diagonal = float(np.linalg.norm(np.ptp(everything, axis=0))) or 1.0
    frame = fit(camera.project(everything), *SIZE, margin=0.1)
    scale = scale or Scale()
    bands = bands_of([layer for layer in layers if isinstance(layer, Surface)], scale)
    with vtk_image.quiet():
        plotter: Any = pyvista.Plotter(window_size=list(SIZE), lighting="none", title="Gibiane")
        plotter.set_background("white")
        plotter.add_light(vtk_image.lamp())
        for layer in layers:
            _add(plotter, layer, camera, frame, bands, diagonal)
        if title:
            plotter.add_text(title, position="upper_left", font_size=11, color="#1b1f24")
        if bands is not None:
            _add_bar(plotter, bands, scale)
        plotter.add_axes(color="#1b1f24")
        plotter.enable_parallel_projection()
        centre = 0.5 * (everything.min(axis=0) + everything.max(axis=0))
        plotter.camera_position = [centre + 2.0 * diagonal * camera.axes[2], centre, camera.axes[1]]
        plotter.camera.SetParallelScale(0.5 * frame.height * frame.pixel)
        _run(plotter, seconds)


def show_picture(path: Path, seconds: float | None = None) -> None:
    """Show a .png file until its window is closed.

    Parameters
    ----------
    path : Path
    seconds : float, optional
        Close by itself after so long.
    """
    import pyvista

    with vtk_image.quiet():
        image = pyvista.read(path)
        width, height = image.dimensions[:2]
        plotter: Any = pyvista.Plotter(window_size=[width, height], title="Gibiane")
        plotter.add_mesh(image, rgb=True, lighting=False, show_scalar_bar=False)
        plotter.enable_parallel_projection()
        plotter.view_xy()
        plotter.enable_image_style()
        plotter.camera.SetParallelScale(0.5 * height)
        _run(plotter, seconds)


def _run(plotter: Any, seconds: float | None) -> None:
    """Open the window and wait for its end."""
    if seconds is None:
        plotter.show()
        return
    plotter.show(interactive_update=True, auto_close=False)
    plotter.update(int(1000 * seconds))
    plotter.close()


def _add(plotter: Any, layer: Layer, camera: Any, frame: Any, bands: Bands | None, diagonal: float) -> None:
    import pyvista

    points = placed(layer)
    match layer:
        case Surface():
            vtk_image.add_surface(plotter, layer, camera, frame, bands)
        case Lines():
            cells = np.insert(np.asarray(layer.cells, np.int64), 0, 2, axis=1).ravel()
            plotter.add_mesh(pyvista.PolyData(points, lines=cells), color=layer.color, line_width=layer.width + 0.5)
        case Dots():
            plotter.add_points(points, color=layer.color, point_size=2.0 * layer.size, render_points_as_spheres=True)
        case Arrows():
            tips = placed(Arrows(layer.points + arrow_factor(layer, diagonal) * layer.vectors, layer.vectors))
            ways = tips - points if layer.offset is None else tips + layer.offset - points
            kept = np.linalg.norm(ways, axis=1) > 0.0
            plotter.add_arrows(points[kept], ways[kept], color=layer.color, show_scalar_bar=False)
        case Labels():
            plotter.add_point_labels(
                points,
                list(layer.texts),
                text_color=layer.color,
                font_size=12,
                shape=None,
                show_points=False,
                always_visible=True,
            )


def _add_bar(plotter: Any, bands: Bands, scale: Scale) -> None:
    """Draw the bands, with their limits."""
    import pyvista

    count = len(bands.colors)
    colors = np.column_stack([255.0 * bands.colors, np.full(count, 255.0)]).round().astype(np.uint8)
    table = pyvista.LookupTable(values=colors, scalar_range=(0.0, float(count)))
    every = -(-(count + 1) // 16)
    table.annotations = {float(k): text for k, text in list(enumerate(bar_labels(bands.limits)))[::every]}
    mapper = pyvista.DataSetMapper()
    mapper.lookup_table = table
    plotter.add_scalar_bar(
        title=scale.title or " ",
        mapper=mapper,
        n_labels=0,
        vertical=True,
        position_x=0.9,
        position_y=0.2,
        width=0.06,
        height=0.6,
        title_font_size=16,
        label_font_size=13,
        color="#1b1f24",
    )
