"""Messages that docs/howto/imported_meshes.md explains are those of files that Netgen refuses."""

import ngsolve as ng
import pytest
from netgen.read_gmsh import ReadGmsh

from ngcontact import Elastic, Problem
from tests.docs.pages import DOCS

PAGE = (DOCS / "howto" / "imported_meshes.md").read_text()

CORNERS = "1 0 0 0\n2 1 0 0\n3 0 1 0"
MIDDLES = "4 0.5 0 0\n5 0.5 0.5 0\n6 0 0.5 0"


def file_of(folder, names, nodes, element):
    """A file of format 2.2 with one element."""
    path, blocks = folder / "part.msh", {"PhysicalNames": names, "Nodes": nodes}
    text = "".join(
        f"${what}\n{data.count(chr(10)) + 1}\n{data}\n$End{what}\n"
        for what, data in (blocks | {"Elements": element}).items()
    )
    path.write_text("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n" + text)
    return str(path)


def test_second_order(tmp_path):
    path = file_of(tmp_path, '2 1 "part"', f"{CORNERS}\n{MIDDLES}", "1 9 2 1 1 1 2 3 4 5 6")
    mesh = ng.Mesh(ReadGmsh(path))
    message = "mesh has dimension 3, and bodies lie in the plane"
    with pytest.raises(ValueError, match=rf"{message}: .*Mesh\.ElementOrder = 1"):
        Problem(geometry=mesh, materials={"part": Elastic(E=1.0, nu=0.3)}).check(mesh)
    assert message in PAGE
