"""Forms in diagnostics: no wider than a window, with what is not optional."""

from gibiane.diagnostics import shortened


def test_a_short_form_stands_as_it_is():
    form = "MAILLAGE = DROIT (n:ENTIER) p:POINT... ('DINI' d:FLOTTANT) ;"
    assert shortened(form) == form


def test_the_last_optional_operands_of_a_wide_form_are_left_out():
    form = "CHPOINT = RESO k:RIGIDITE (prec:FLOTTANT) ('PENA'|'UZAW' r:FLOTTANT) ('STATUT' (sn:FLOTTANT)) ('SOUC') "
    form += "f:CHPOINT ;"
    assert shortened(form, 80) == "CHPOINT = RESO k:RIGIDITE (prec:FLOTTANT) f:CHPOINT ... ;"
    assert shortened(form, 20) == "CHPOINT = RESO k:RIGIDITE f:CHPOINT ... ;"


def test_of_many_keywords_those_stay_that_have_room():
    form = "MAILLAGE = CHANGER g:MAILLAGE ('POI1'|'SEG2'|'LIGNE'|'SURFACE'|'LINEAIRE'|'QUADRATIQUE') ;"
    assert shortened(form, 64) == "MAILLAGE = CHANGER g:MAILLAGE ('POI1'|'SEG2'|'LIGNE'|...) ... ;"
    for width in range(50, 100):
        assert len(shortened(form, width)) <= width
