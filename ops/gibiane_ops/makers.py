"""Which operators make an object of each type: the hint of an error that misses one."""

from __future__ import annotations

from gibiane.diagnostics import Text

MAKERS = {
    "CHPOINT": Text("MANU 'CHPO', FORC, PRES, RESO and others make a CHPOINT"),
    "DEFORME": Text("DEFO makes a DEFORME of a mesh and a displacement"),
    "EVOLUTIO": Text("EVOL makes an EVOLUTIO of two lists"),
    "LISTENTI": Text("LECT makes a LISTENTI of integers: LECT 1 2 3"),
    "LISTMOTS": Text("MOTS makes a LISTMOTS of words: MOTS 'UX' 'UY'"),
    "LISTREEL": Text("PROG makes a LISTREEL of numbers: PROG 0. 0.5 1."),
    "MAILLAGE": Text("DROI, TRAN, DALL, VOLU and others make a MAILLAGE"),
    "MCHAML": Text("MATE makes the material of a model, SIGM and EPSI its stresses and strains"),
    "MMODEL": Text("MODE makes a MMODEL of a mesh: MODE G 'MECANIQUE' 'ELASTIQUE'"),
    "POINT": Text("a POINT is written by its coordinates, once OPTI DIME 2 or 3 is set: (0. 1.)"),
    "RIGIDITE": Text("RIGI makes a RIGIDITE of a model and its material, BLOQ of conditions"),
    "TABLE": Text("TABL makes a TABLE"),
    "VECTEUR": Text("VECT makes a VECTEUR of a CHPOINT"),
}
