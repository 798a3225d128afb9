"""Unilateral contact with Coulomb friction on node pairs, condensed on the contact surface.

Sign conventions of the whole package: body 1 (slave) and body 2 (master) face each other, ``n`` is the outward normal
of body 1, ``w = u1 - u2`` is the relative displacement of a pair and ``r`` the nodal force that body 1 receives.
Non-penetration reads ``w_n <= gap`` with ``gap >= 0``, and ``r_n <= 0`` in compression.
"""
