"""A session that ended leaves nothing behind: workers run hundreds of cases, each in a session of its own."""

import gc
import io
import weakref

from gibiane.session import Session

# numbers in loops are run by closures, which give up on what is no number
SCRIPT = """
REPE B 20 ; X = &B + 1 ; FIN B ;
L = PROG 1. 2. ;
REPE B 20 ; Y = L + 1. ; FIN B ;
DEBP P X ; FINP (X + X) ;
REPE B 20 ; Z = P L ; FIN B ;
"""


def test_a_session_is_freed():
    session = Session(out=io.StringIO(), err=io.StringIO())
    assert session.run_text(SCRIPT) == 0, session.err.getvalue()
    left = weakref.ref(session)
    del session
    gc.collect()
    assert left() is None
