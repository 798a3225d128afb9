"""The sentences of messages in French, by their English template; the fields in braces are the same.

A sentence that no module holds any more is removed, a new one added: tests/unit/gibiane/test_messages.py names both.
"""

from gibiane.messages_fr.estimation import ESTIMATION
from gibiane.messages_fr.geometry import GEOMETRY
from gibiane.messages_fr.language import LANGUAGE
from gibiane.messages_fr.lists import LISTS
from gibiane.messages_fr.mechanics import MECHANICS
from gibiane.messages_fr.mesh import MESH
from gibiane.messages_fr.numbers import NUMBERS
from gibiane.messages_fr.pictures import PICTURES
from gibiane.messages_fr.solutions import SOLUTIONS

FRENCH: dict[str, str] = {
    **LANGUAGE,
    **LISTS,
    **MESH,
    **MECHANICS,
    **ESTIMATION,
    **NUMBERS,
    **PICTURES,
    **SOLUTIONS,
    **GEOMETRY,
}
