"""Filled surfaces as an image, drawn by VTK through PyVista without a window; the same contract as `image.render`."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np

from gibiane_ops.kernels.plot.camera import Camera, FloatArray, Frame
from gibiane_ops.kernels.plot.image import EDGE_INK, FINER, LIGHT, ink_of, mean_of_samples, visible_inks
from gibiane_ops.kernels.plot.layers import Surface, edges_of, placed, sharp_sides
from gibiane_ops.kernels.plot.raster import IntArray
from gibiane_ops.kernels.plot.scales import UNDEFINED, Bands

DEBIAN_PACKAGES = ("libegl1", "libegl-mesa0", "libgl1", "libgl1-mesa-dri", "libxrender1")
"""What VTK needs to draw without a screen; software rendering comes with libgl1-mesa-dri."""

SURFACELESS = 0x31DD  # EGL_PLATFORM_SURFACELESS_MESA


@cache
def obstacle() -> str | None:
    """Say what keeps VTK from drawing here.

    Returns
    -------
    str or None
        None when it can; "pyvista" when the package is not installed, else the library that is missing. VTK itself
        would end the process where there is no OpenGL: it is asked only after this.
    """
    if importlib.util.find_spec("pyvista") is None:
        return "pyvista"
    if sys.platform != "linux":
        return None
    for library in ("libEGL.so.1", "libGL.so.1", "libXrender.so.1"):
        try:
            ctypes.CDLL(library)
        except OSError:
            return library
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetPlatformDisplay.restype = ctypes.c_void_p
    egl.eglGetPlatformDisplay.argtypes = [ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p]
    egl.eglInitialize.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
    with quiet():
        display = egl.eglGetPlatformDisplay(SURFACELESS, None, None)
        usable = bool(display) and bool(egl.eglInitialize(display, None, None))
    return None if usable else "libEGL_mesa.so.0"


@contextmanager
def quiet() -> Iterator[None]:
    """Keep what VTK and Mesa have to say away from the user: they write to the descriptors of the process."""
    os.environ.setdefault("EGL_LOG_LEVEL", "fatal")
    sys.stderr.flush()
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def render(
    surfaces: Sequence[Surface], camera: Camera, frame: Frame, bands: Bands | None
) -> tuple[FloatArray, FloatArray]:
    """Draw surfaces: arguments and results are those of `image.render`.

    Notes
    -----
    Orthographic; bands are cut out of the facets at their limits, so that their bounds are exact. Transparent surfaces
    show all that is behind them.

    Cost
    ----
    About 0.2 s for 1200 x 900 pixels by software, after a start of about one second.
    """
    fine = frame.finer(FINER)
    opaque = [s for s in surfaces if s.alpha >= 1.0]
    with quiet():
        image, depth = _draw(surfaces, camera, fine, bands)
        if len(opaque) < len(surfaces):
            depth = _draw(opaque, camera, fine, bands)[1] if opaque else np.full(depth.shape, -np.inf)
    return mean_of_samples(image), depth


def _draw(
    surfaces: Sequence[Surface], camera: Camera, fine: Frame, bands: Bands | None
) -> tuple[FloatArray, FloatArray]:
    import pyvista

    points = np.concatenate([placed(s) for s in surfaces])
    screen = camera.project(points)
    near, far = float(screen[:, 2].max()), float(screen[:, 2].min())
    # some room, so that nothing lies on the planes that bound what is seen
    room = 0.05 * (near - far) + fine.pixel
    near, far = near + room, far - room
    left, right, bottom, top = fine.extent
    middle = np.array([0.5 * (left + right), 0.5 * (bottom + top), near]) @ camera.axes
    with _off_screen():
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=[fine.width, fine.height], lighting="none")
    try:
        plotter.set_background("white")
        plotter.add_light(lamp())
        for surface in surfaces:
            add_surface(plotter, surface, camera, fine, bands)
        eye = plotter.camera
        eye.SetParallelProjection(True)
        eye.SetPosition(*middle)
        eye.SetFocalPoint(*(middle - camera.axes[2]))
        eye.SetViewUp(*camera.axes[1])
        eye.SetParallelScale(0.5 * (top - bottom))
        eye.SetClippingRange(1e-9 * (near - far), near - far)
        if any(s.alpha < 1.0 for s in surfaces):
            plotter.enable_depth_peeling(8)
        plotter.render_window.SetMultiSamples(0)  # the samples of a pixel are its FINER x FINER parts
        plotter.renderer.SetUseFXAA(False)
        plotter.camera_set = True
        image = np.asarray(plotter.screenshot(return_img=True, transparent_background=True), np.float64) / 255.0
        first, last = eye.GetClippingRange()  # PyVista may have fitted it to what is seen
        heights = _depth_buffer(plotter.render_window, fine)
    finally:
        plotter.close()
    depth = np.where(heights < 1.0, near - (first + heights * (last - first)), -np.inf)
    return image[::-1], depth


def _depth_buffer(window: Any, fine: Frame) -> FloatArray:
    """Return the depths of a window from 0 to 1, row 0 the bottom one; 1 where nothing is seen."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkFloatArray

    found = vtkFloatArray()
    window.GetZbufferData(0, 0, fine.width - 1, fine.height - 1, found)
    return np.asarray(pyvista.convert_array(found), np.float64).reshape(fine.height, fine.width)


@contextmanager
def _off_screen() -> Iterator[None]:
    """On Linux ask for a window of EGL at once: VTK would try a screen first, and complain."""
    name = "VTK_DEFAULT_OPENGL_WINDOW"
    before = os.environ.get(name)
    if sys.platform == "linux":
        os.environ[name] = "vtkEGLRenderWindow"
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = before


def lamp() -> Any:
    """Return the lamp of pictures, which stays with the eye."""
    import pyvista

    light = pyvista.Light(light_type="camera light", intensity=1.0)
    light.position = tuple(LIGHT)
    light.focal_point = (0.0, 0.0, 0.0)
    return light


def add_surface(plotter: Any, surface: Surface, camera: Camera, fine: Frame, bands: Bands | None) -> None:
    """Add the facets of a surface, then its edges."""
    points = placed(surface)
    valued = surface.nodal is not None or surface.flat is not None
    dark = 0.86 if valued else 0.68
    common = {
        "ambient": dark,
        "diffuse": 1.03 - dark,
        "specular": 0.0,
        "opacity": surface.alpha,
        "show_scalar_bar": False,
        "smooth_shading": False,
        "reset_camera": False,
        "render": False,
    }
    for mesh, colors in _painted(points, surface, bands):
        if colors is None:
            plotter.add_mesh(mesh, color=surface.color, **common)
        else:
            mesh.cell_data["colour"] = (255.0 * colors).round().astype(np.uint8)
            plotter.add_mesh(mesh, scalars="colour", rgb=True, **common)
    _add_edges(plotter, surface, points, camera, fine)


def _painted(points: FloatArray, surface: Surface, bands: Bands | None) -> Iterator[tuple[Any, FloatArray | None]]:
    """Yield polygons with the colour of each (None: that of the surface)."""
    facets = [np.asarray(f, np.int64) for f in surface.facets if len(f)]
    if surface.nodal is None:
        mesh, _, owner = _fans(points, np.zeros(len(points)), facets)
        flat = surface.flat
        yield mesh, None if flat is None or bands is None else bands.paint(np.asarray(flat, np.float64)[owner])
        return
    values = np.asarray(surface.nodal, np.float64)
    if bands is None:
        return
    whole = [np.isfinite(values[f]).all(axis=1) for f in facets]
    lost = [f[~w] for f, w in zip(facets, whole, strict=True) if (~w).any()]
    if lost:
        mesh, _, owner = _fans(points, values, lost)
        yield mesh, np.tile(UNDEFINED, (len(owner), 1))
    kept = [f[w] for f, w in zip(facets, whole, strict=True) if w.any()]
    if kept:
        mesh, own, _ = _fans(points, np.where(np.isfinite(values), values, bands.low), kept)
        yield _banded(mesh, own, bands)


def _fans(points: FloatArray, values: FloatArray, facets: Sequence[IntArray]) -> tuple[Any, FloatArray, IntArray]:
    """Cut facets of more than three corners into triangles around their centres, so that no diagonal is favoured.

    Returns the triangles, the values at their points, and the facet of each.
    """
    import pyvista

    triangles, owners, first = [], [], 0
    for f in facets:
        count = f.shape[1]
        owner = np.arange(first, first + len(f))
        first += len(f)
        if count == 3:
            triangles.append(f)
            owners.append(owner)
            continue
        centre = np.repeat(len(points) + np.arange(len(f)), count)
        points = np.concatenate([points, points[f].mean(axis=1)])
        values = np.concatenate([values, values[f].mean(axis=1)])
        triangles.append(np.column_stack([centre, f.ravel(), np.roll(f, -1, axis=1).ravel()]))
        owners.append(np.repeat(owner, count))
    return pyvista.PolyData(points, _packed(triangles)), values, np.concatenate(owners)


def _banded(mesh: Any, values: FloatArray, bands: Bands) -> tuple[Any, FloatArray]:
    """Cut polygons at the limits of the bands."""
    import pyvista
    from vtkmodules.vtkFiltersModeling import vtkBandedPolyDataContourFilter

    inner = bands.limits[1:-1]
    mesh.point_data["value"] = values
    mesh.set_active_scalars("value")
    cutter = vtkBandedPolyDataContourFilter()
    cutter.SetInputData(mesh)
    # the filter makes a cut at each value, and keeps what lies beyond the last ones: the outer limits are no cuts
    cutter.SetNumberOfContours(max(len(inner), 1))
    for i, limit in enumerate(inner if len(inner) else bands.limits[-1:]):
        cutter.SetValue(i, float(limit))
    cutter.SetScalarModeToValue()
    cutter.SetClipping(False)
    cutter.Update()
    cut = pyvista.wrap(cutter.GetOutput())
    polygons = cut.GetPolys()
    sizes = np.diff(pyvista.convert_array(polygons.GetOffsetsArray()))
    corners = pyvista.convert_array(polygons.GetConnectivityArray())
    # a corner stands on a limit of the band, the mean of all corners inside it
    owner = np.repeat(np.arange(len(sizes)), sizes)
    mean = np.bincount(owner, weights=cut.point_data["value"][corners], minlength=len(sizes)) / sizes
    cut.clear_data()
    return cut, bands.paint(mean)


def _packed(facets: Sequence[Any]) -> Any:
    """Write polygons as VTK wants them: number of corners, corners."""
    return np.concatenate([np.insert(f, 0, f.shape[1], axis=1).ravel() for f in facets])


def _add_edges(plotter: Any, surface: Surface, points: FloatArray, camera: Camera, fine: Frame) -> None:
    """Draw the sides of facets as lines, those that outline the surface broader and darker."""
    import pyvista

    sides, _ = edges_of(surface.facets)
    broad = sharp_sides(points, surface.facets)
    pixels = fine.pixels(camera.project(points))
    ink = ink_of(pixels[sides[:, 1]] - pixels[sides[:, 0]], broad) if surface.edges else visible_inks(broad)
    for chosen, width in ((~broad, 0.85 * FINER), (broad, 1.6 * FINER)):
        drawn = chosen & (ink > 0.02)
        if not drawn.any():
            continue
        pairs = np.unique(np.sort(sides[drawn], axis=1), axis=0)
        lines = pyvista.PolyData(points, lines=_packed([pairs]))
        actor = plotter.add_mesh(
            lines,
            color=tuple(EDGE_INK),
            opacity=float(ink[drawn].mean()) * surface.alpha,
            line_width=width,
            lighting=False,
            show_scalar_bar=False,
            reset_camera=False,
            render=False,
        )
        mapper = actor.GetMapper()
        mapper.SetResolveCoincidentTopologyToPolygonOffset()
        mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, -8.0)
