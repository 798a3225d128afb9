"""Time and date: TEMPS, DATE."""

from __future__ import annotations

import time
from typing import Any

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, FLOTTANT, MOT, TABLE, Table

DATE_WIDTH = 32
MONTHS = {
    "fr": "janvier février mars avril mai juin juillet août septembre octobre novembre décembre".split(),
    "en": "January February March April May June July August September October November December".split(),
}

TEMP = operator(
    "TEMPS",
    topic="language",
    summary="time since the start, or since the last call",
    notice="`TEMPS ;` prints the seconds since the session began and since the last call. `TEMPS 'ZERO'` "
    "starts the clock again. 'CPU' and 'HORL' give, as an ENTIER, the milliseconds of processor or of "
    "the clock on the wall since 'ZERO'. 'NOEC' gives both in a table, without printing: T.'TEMPS_CPU' "
    "and T.'TEMPS_HORLOGE', each with 'INITIAL' (since the start) and 'PRECEDENT' (since the last call).",
    example="TEMPS 'ZERO' ; X = TEMPS 'HORL' ; MESS (X < 10000) ;",
    see=["DATE"],
)


class _Clock:
    """Instants of a session: its start, 'ZERO', the last call; each (wall clock, processor) in seconds."""

    def __init__(self, started: float) -> None:
        self.start = self.zero = self.last = (started, 0.0)

    @staticmethod
    def now() -> tuple[float, float]:
        """Return this instant."""
        return time.perf_counter(), time.process_time()


def _clock(ctx: Context) -> _Clock:
    found = ctx.state.get("clock")
    if found is None:
        found = ctx.state["clock"] = _Clock(ctx.session.started)
    return found


def _milliseconds(now: tuple[float, float], since: tuple[float, float], which: int) -> int:
    return round(1000.0 * (now[which] - since[which]))


@TEMP.form(Key(("CPU", "HORLOGE"), "milliseconds since 'ZERO'", name="which", required=True), gives=[ENTIER])
def _elapsed(ctx: Context, which: str) -> int:
    clock = _clock(ctx)
    return _milliseconds(clock.now(), clock.zero, int(which == "CPU"))


@TEMP.form(Key("NOEC", "times in a table", required=True), gives=[TABLE])
def _silent(ctx: Context, noec: bool) -> Table:
    clock = _clock(ctx)
    now = clock.now()
    found = Table()
    for which, name in enumerate(("TEMPS_HORLOGE", "TEMPS_CPU")):
        times = Table()
        times.set("INITIAL", _milliseconds(now, clock.start, which))
        times.set("PRECEDENT", _milliseconds(now, clock.last, which))
        found.set(name, times)
    clock.last = now
    return found


@TEMP.form(
    Key(("ZERO", "IMPR"), "start the clock again, or print it", name="what"),
    Key(("MAXI", "SOMM"), "of Cast3M, which has several processes: nothing changes", name="over"),
    Key(("CPU", "HORLOGE"), "of Cast3M: both times are printed", name="which"),
    last=True,
)
def _print(ctx: Context, what: str | None, over: str | None, which: str | None) -> None:
    clock = _clock(ctx)
    now = clock.now()
    if what == "ZERO":
        clock.zero = now
    else:
        ctx.write(f" TEMPS ECOULE : {now[0] - clock.start[0]:.2f} s DONT {now[0] - clock.last[0]:.2f} s")
    clock.last = now


DATE = operator(
    "DATE",
    topic="language",
    summary="date and time of day, in a word or as numbers",
    notice="`DATE` gives `dd/mm/yyyy - hh:mm:ss`; 'ANNEE', 'MOIS', 'JOUR', 'HEURE', 'MINUTE' or 'SECONDE' "
    "one of its numbers; 'LETTRE' the month as a word. 'EPOCH' gives seconds that grow from call to "
    "call; 'CONVERSION' writes seconds as days, hours, minutes and seconds.",
    example="MESS (DATE 'CONVERSION' 123456.789) ;",
    see=["TEMPS"],
)
PARTS = {"ANNEE": "year", "MOIS": "month", "JOUR": "day", "HEURE": "hour", "MINUTE": "minute", "SECONDE": "second"}
LETTRE = Key("LETTRE", "month as a word")


@DATE.form(Key("EPOCH", "seconds that grow", required=True), gives=[FLOTTANT])
def _epoch(ctx: Context, epoch: bool) -> float:
    return time.time()


@DATE.form(Key("CONVERSION", "seconds in days, hours, minutes", Arg("seconds", FLOTTANT), required=True), gives=[MOT])
def _convert(ctx: Context, conversion: float) -> str:
    if not abs(conversion) < 1e14:
        ctx.fail(26, "{seconds} seconds are no length of time", at="conversion", seconds=conversion)
    minutes, seconds = divmod(conversion, 60.0)
    hours, minute = divmod(int(minutes), 60)
    days, hour = divmod(hours, 24)
    return f"{days:9d}J {hour:02d}H {minute:02d}min {seconds:6.3f}sec".ljust(DATE_WIDTH)


@DATE.form(LETTRE, Key(tuple(PARTS), "one of its numbers", name="part"), gives=["MOT|ENTIER"], last=True)
def _date(ctx: Context, lettre: bool, part: str | None) -> Any:
    from datetime import datetime  # slow to import, and seldom asked for

    now = datetime.now()
    month = MONTHS[ctx.session.lang][now.month - 1]
    if part == "MOIS" and lettre:
        return month
    if part is not None:
        return int(getattr(now, PARTS[part]))
    if lettre:
        return f"{now.day} {month} {now.year} - {now.hour:02d}H{now.minute:02d}min".ljust(DATE_WIDTH)
    return now.strftime("%d/%m/%Y - %H:%M:%S").ljust(DATE_WIDTH)
