"""Fortran images of numbers: the default E and G styles, and FORMAT descriptors."""

from __future__ import annotations

import math
import re


def scientific(x: float, width: int = 12, digits: int = 5, letter: str = "E") -> str:
    """Return `x` as 1PEw.d: one digit before the point, two-digit exponent (three drop the letter)."""
    if not math.isfinite(x):
        return _special(x, width)
    mantissa, _, exponent = f"{x:.{digits}E}".partition("E")
    power = int(exponent)
    tail = f"{letter}{power:+03d}" if abs(power) < 100 else f"{power:+04d}"
    return _fit(mantissa + tail, width)


def general(x: float, width: int = 12, digits: int = 5) -> str:
    """Return `x` as 1PGw.d: five significant digits and four blanks for 0.1 <= |x| < 1e5, else E style."""
    if not math.isfinite(x):
        return _special(x, width)
    if x == 0:
        return _fit(f"{0:.{digits - 1}f}", width - 4) + "    "
    if 0.1 <= abs(x) < 10.0**digits:
        rounded = float(f"{x:.{digits - 1}E}")
        if abs(rounded) < 10.0**digits:
            before = max(1, math.floor(math.log10(abs(rounded))) + 1) if abs(rounded) >= 1 else 0
            text = f"{rounded:.{digits - before}f}" + ("." if digits == before else "")
            return _fit(text, width - 4) + "    "
    return scientific(x, width, digits)


def _special(x: float, width: int) -> str:
    word = "NaN" if math.isnan(x) else "Infinity" if x > 0 else "-Infinity"
    return word.rjust(width)


def _fit(text: str, width: int) -> str:
    if width == 0:
        return text
    return text.rjust(width) if len(text) <= width else "*" * width


_DESCRIPTOR = re.compile(
    r"(?P<sp>SP,?)?(?:(?P<scale>[+-]?\d+)P,?)?(?P<sp2>SP,?)?(?P<count>\d+)?(?P<kind>ES|EN|[FEDGIA])"
    r"(?P<width>\d+)?(?:\.(?P<digits>\d+))?(?:E(?P<exp>\d+))?$",
    re.IGNORECASE,
)


class BadFormat(Exception):
    """A FORMAT descriptor that cannot be used, and why (a sentence with its fields)."""

    def __init__(self, template: str, **fields: str) -> None:
        super().__init__(template)
        self.template = template
        self.fields = fields


class Format:
    """One descriptor such as `(1PE12.5)`, `(F6.2)`, `(I5)`."""

    def __init__(self, text: str) -> None:
        inner = text.strip()
        if not (inner.startswith("(") and inner.endswith(")")):
            raise BadFormat("a format stands between parentheses: ({inner})", inner=inner)
        found = _DESCRIPTOR.match(inner[1:-1].replace(" ", ""))
        if found is None:
            raise BadFormat("known descriptors: Fw.d Ew.d Dw.d ESw.d Gw.d Iw Aw, with 1P and SP before them")
        self.kind = found["kind"].upper()
        self.scale = int(found["scale"] or 0)
        self.plus = bool(found["sp"] or found["sp2"])
        self.width = int(found["width"] or 0)
        self.digits = int(found["digits"] or 0)

    def image(self, x: float) -> str:
        """Return the image of a real.

        Raises
        ------
        BadFormat
            For `I` with a real.
        """
        if self.kind == "I":
            raise BadFormat("the descriptor I is for integers, and this value is a FLOTTANT")
        if self.kind == "A":
            raise BadFormat("the descriptor A is for words, and this value is a FLOTTANT")
        text = self._plain(x)
        if self.plus and not text.strip().startswith("-") and math.isfinite(x):
            text = _fit("+" + text.strip(), self.width)
        return text

    def integer(self, n: int) -> str:
        """Return the image of an integer: by `Iw`, else as short as it is."""
        return _fit(str(n), self.width) if self.kind == "I" else str(n)

    def word(self, word: str) -> str:
        """Return the image of a word: by `Aw` cut or padded on the left, else as it is."""
        return word[: self.width].rjust(self.width) if self.kind == "A" and self.width else word

    def _plain(self, x: float) -> str:
        if not math.isfinite(x):
            return _special(x, self.width)
        if self.kind == "F":
            return self._fixed(x * 10.0**self.scale)
        if self.kind == "ES":
            return scientific(x, self.width, self.digits)
        if self.kind == "G":
            return self._general(x)
        return self._exponent(x, "D" if self.kind == "D" else "E")

    def _fixed(self, x: float) -> str:
        text = f"{x:.{self.digits}f}" + ("." if self.digits == 0 else "")
        if self.width and len(text) > self.width and text.lstrip("-").startswith("0."):
            text = text.replace("0.", ".", 1)
        return _fit(text, self.width)

    def _exponent(self, x: float, letter: str) -> str:
        if self.scale == 1:
            return scientific(x, self.width, self.digits, letter)
        if x == 0:
            text = f"{0:.{self.digits}f}{letter}+00"
        else:
            mantissa, _, exponent = f"{x:.{max(self.digits - 1, 0)}E}".partition("E")
            digits = mantissa.replace(".", "").replace("-", "")
            power = int(exponent) + 1
            tail = f"{letter}{power:+03d}" if abs(power) < 100 else f"{power:+04d}"
            text = ("-" if x < 0 else "") + "0." + digits + tail
        if self.width and len(text) == self.width + 1:
            text = text.replace("0.", ".", 1)
        return _fit(text, self.width)

    def _general(self, x: float) -> str:
        digits = self.digits or 5
        if x == 0 or 0.1 <= abs(x) < 10.0**digits:
            return general(x, self.width or 12, digits)
        return self._exponent(x, "E")


DEFAULT = Format("(1PE12.5)")
