"""CalculiX: writes the deck of a two-block test, runs ccx, parses results.
usage: ccx_contact.py OUTDIR CASE MU TYPE [ELEM] [KN] [KT] [SINF]
TYPE: N2S (node to surface), S2S (surface to surface), MORTAR, LINMORTAR, BONDED
ELEM: C3D8 (default), C3D8I, C3D8R; KN normal stiffness [N/mm3], KT stick slope [N/mm3], SINF tension at infinity.
--nodes=FILE keeps the displacements of all nodes (npz: points, upper, u)."""
import sys, os, re, json, time, subprocess, resource
import numpy as np
from blocks import case, joined, named, E, NU, P

nodes_file = next((a[8:] for a in sys.argv if a.startswith("--nodes=")), None)
sys.argv = [a for a in sys.argv if not a.startswith("--nodes=")]
out, name, mu, typ = sys.argv[1], sys.argv[2], float(sys.argv[3]), sys.argv[4]
elem = sys.argv[5] if len(sys.argv) > 5 else "C3D8"
kn = float(sys.argv[6]) if len(sys.argv) > 6 else 1e9
kt = float(sys.argv[7]) if len(sys.argv) > 7 else kn / 10
sinf = float(sys.argv[8]) if len(sys.argv) > 8 else 0.0      # N2S only: tension kept at large clearance [MPa]
os.makedirs(out, exist_ok=True)
c = case(name)
bonded = typ == "BONDED"
xyz, cl, cu, pairs, base, top = joined(c, bonded)
nm = named(c, xyz, pairs)
job = f"{name}_{typ}_{mu}"
with open(os.path.join(out, job + ".inp"), "w") as f:
    w = f.write
    w("*NODE, NSET=NALL\n")
    for i, p in enumerate(xyz):
        w("%d, %.9g, %.9g, %.9g\n" % (i + 1, *p))
    k = 0
    sets = {}
    for nmset, con in (("LOW", cl), ("UP", cu)):
        w(f"*ELEMENT, TYPE={elem}, ELSET={nmset}\n")
        sets[nmset] = k
        for e in con:
            k += 1
            w(",".join(map(str, [k] + (e + 1).tolist())) + "\n")

    def nset(n, ids):
        w(f"*NSET, NSET={n}\n")
        for i in range(0, len(ids), 8):
            w(",".join(str(j + 1) for j in ids[i:i + 8]) + "\n")
    nset("BASE", base)
    nset("OBS", list(dict.fromkeys(nm.values())))
    nset("CUP", pairs[:, 0]); nset("CLO", pairs[:, 1])
    w("*MATERIAL, NAME=STEEL\n*ELASTIC\n%g, %g\n" % (E, NU))
    w("*SOLID SECTION, ELSET=LOW, MATERIAL=STEEL\n*SOLID SECTION, ELSET=UP, MATERIAL=STEEL\n")

    zt = np.abs(xyz[cu[:, 4], 2] - c["H"]) < 1e-9
    if c["half"]:
        zt &= xyz[cu].mean(1)[:, 0] > 0
    zt = np.where(zt)[0] + sets["UP"] + 1
    if not bonded:
        zu = np.where(np.abs(xyz[cu[:, 0], 2]) < 1e-9)[0] + sets["UP"] + 1
        ctr = xyz[cl].mean(1)
        zl = np.where((np.abs(xyz[cl[:, 4], 2]) < 1e-9) & (np.abs(ctr[:, :2]).max(1) < c["a"]))[0] + 1
        if typ == "N2S":
            w("*SURFACE, NAME=SLAVE, TYPE=NODE\nCUP\n")
        else:
            w("*SURFACE, NAME=SLAVE\n" + "".join(f"{e}, S1\n" for e in zu))
        w("*SURFACE, NAME=MASTER\n" + "".join(f"{e}, S2\n" for e in zl))
        t = {"N2S": "NODE TO SURFACE, SMALL SLIDING", "S2S": "SURFACE TO SURFACE", "MORTAR": "MORTAR", "LINMORTAR": "LINMORTAR"}[typ]
        w(f"*CONTACT PAIR, INTERACTION=I1, TYPE={t}\nSLAVE, MASTER\n*SURFACE INTERACTION, NAME=I1\n")
        if "MORTAR" in typ:
            w("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD\n")
        else:
            w("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n%g%s\n" % (kn, ", %g" % sinf if sinf else ""))
        if mu > 0:
            w("*FRICTION\n%g, %g\n" % (mu, kt))
    w("*STEP%s\n*STATIC%s\n1., 1.\n" % ("" if bonded else ", INC=200", "" if bonded else ", DIRECT"))
    w("*BOUNDARY\nBASE, 1, 3\n*DLOAD\n" + "".join(f"{e}, P2, {P}\n" for e in zt))
    w("*NODE PRINT, NSET=OBS, FREQUENCY=1\nU\n*NODE PRINT, NSET=CUP\nU\n*NODE PRINT, NSET=CLO\nU\n*NODE PRINT, NSET=BASE, TOTALS=ONLY\nRF\n")
    if nodes_file:
        w("*NODE PRINT, NSET=NALL\nU\n")
    w("*END STEP\n")
t = time.perf_counter()
p = subprocess.run(["ccx", "-i", job], cwd=out, capture_output=True, text=True, timeout=1800)
wall = time.perf_counter() - t
open(os.path.join(out, job + ".log"), "w").write(p.stdout + p.stderr)
txt = p.stdout
o = dict(solver="ccx " + typ, elem=elem, case=name, mu=mu, kn=kn, kt=kt, sinf=sinf, wall=wall, rc=p.returncode,
         rss_MB=resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024,
         iters=len(re.findall(r"^\s*iteration +\d+", txt, re.M)), incs=len(re.findall(r"^ increment", txt, re.M)),
         finished="Job finished" in txt)
try:
    blocks = re.split(r"\n (?=displacements|total force|forces)", "\n" + open(os.path.join(out, job + ".dat")).read())
    data = {}
    for b in blocks:
        h = re.search(r"for set (\w+)", b)
        if h:
            data[("U" if b.startswith("disp") else "RF", h.group(1))] = np.array(
                [[float(x) for x in l.split()] for l in b.splitlines()[1:] if l.strip()])
    D = {int(r[0]) - 1: r[1:] for r in np.vstack([data[("U", s)] for s in ("OBS", "CUP", "CLO")])}
    for k_, i in nm.items():
        o["uz_" + k_] = D[i][2]
    o["ux_top_corner"] = D[nm["top_corner"]][0]; o["ux_cont_corner_up"] = D[nm["cont_corner_up"]][0]
    if not bonded:
        w_ = np.array([D[a_] - D[b_] for a_, b_ in pairs])
        wt = np.linalg.norm(w_[:, :2], axis=1)
        o.update(max_slip=wt.max(), n_slip=int((wt > 1e-6).sum()), max_gap=w_[:, 2].max(), min_gap=w_[:, 2].min(),
                 slip_corner=wt[np.argmax(xyz[pairs[:, 0]][:, :2].sum(1))])
    if nodes_file:
        all_u = data[("U", "NALL")]
        u_ = np.zeros_like(xyz); u_[all_u[:, 0].astype(int) - 1] = all_u[:, 1:4]
        np.savez(nodes_file, points=xyz, upper=np.arange(len(xyz)) >= len(xyz) - len(np.unique(cu)), u=u_)
    o["sum_Rz_base"] = data[("RF", "BASE")].ravel()[-1]
except Exception as ex:
    o["parse"] = repr(ex)
    o["tail"] = txt[-400:]
print(json.dumps({k: (float(v) if isinstance(v, np.floating) else v) for k, v in o.items()}))
