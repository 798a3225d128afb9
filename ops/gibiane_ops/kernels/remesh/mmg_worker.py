"""Program that runs Mmg on arrays from its input and writes arrays to its output.

Mmg ends the process on what it does not understand, and takes over its signals: it has a process of its own, which may
die and may be interrupted. This file is run as it stands and imports nothing of Gibiane.
"""

import io
import os
import sys
from typing import Any

try:
    import resource
except ImportError:  # not on Windows
    resource = None  # type: ignore[assignment]


def main() -> int:
    """Read an npz of arrays and options, make the mesh, write an npz; 1 when Mmg gives up."""
    import mmgpy
    import numpy as np

    # What Mmg prints must not mix with the result.
    result = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with np.load(io.BytesIO(sys.stdin.buffer.read())) as given:
        old = dict(given)
    if resource is not None:
        seconds = int(old["seconds"])
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    space = "tetrahedra" in old
    mesh: Any = mmgpy.MmgMesh3D() if space else mmgpy.MmgMesh2D()
    volumes = {"tetrahedra": len(old["tetrahedra"])} if space else {}
    mesh.set_mesh_size(
        vertices=len(old["vertices"]), triangles=len(old["triangles"]), edges=len(old["edges"]), **volumes
    )
    mesh.set_vertices(old["vertices"])
    if space:
        mesh.set_tetrahedra(old["tetrahedra"], old["region"])
    mesh.set_triangles(old["triangles"], old["patch"])
    mesh.set_edges(old["edges"], old["chain"])
    mesh.set_corners(old["corners"])
    mesh.set_required_vertices(old["corners"])
    mesh["tensor"] = old["metric"]
    try:
        mesh.remesh(hgrad=-1.0, hgradreq=-1.0, hausd=float(old["stray"]), ar=float(old["angle"]), verbose=-1)
    except RuntimeError as error:
        print(error, file=sys.stderr)
        return 1
    new: dict[str, Any] = {"vertices": mesh.get_vertices()}
    if space:
        new["tetrahedra"], new["region"] = mesh.get_tetrahedra_with_refs()
    new["triangles"], new["patch"] = mesh.get_triangles_with_refs()
    new["edges"], new["chain"] = mesh.get_edges_with_refs()
    buffer = io.BytesIO()
    np.savez(buffer, **new)
    result.write(buffer.getvalue())
    result.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
