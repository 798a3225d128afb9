"""scikit-fem, which has no contact: the two blocks tied, Q1 hexahedra. usage: skfem_tied.py CASE [spsolve|cg|pardiso] [--nodes=FILE]"""
import sys, time, json, resource
t00 = time.perf_counter()
import numpy as np, scipy.sparse as sp, scipy.sparse.linalg as spl
import skfem as fe
from skfem.models.elasticity import linear_elasticity, lame_parameters
timp = time.perf_counter() - t00
from blocks import *
nodes_file = next((a[8:] for a in sys.argv if a.startswith("--nodes=")), None)
sys.argv = [a for a in sys.argv if not a.startswith("--nodes=")]
c = case(sys.argv[1]); how = sys.argv[2] if len(sys.argv) > 2 else "spsolve"
xyz, cl, cu, pairs, base, top = joined(c, True); nm = named(c, xyz, pairs)
t0 = time.perf_counter()
con = np.vstack([cl, cu])
# scikit-fem hex ordering: (0,0,0) (0,0,1) (0,1,0) (1,0,0) (0,1,1) (1,0,1) (1,1,0) (1,1,1)
con = con[:, [0, 4, 3, 1, 7, 5, 2, 6]]
m = fe.MeshHex(np.ascontiguousarray(xyz.T), np.ascontiguousarray(con.T))
ib = fe.Basis(m, fe.ElementVector(fe.ElementHex1()), intorder=3)
tm = time.perf_counter()
K = linear_elasticity(*lame_parameters(E, NU)).assemble(ib)
fb = fe.FacetBasis(m, ib.elem, facets=m.facets_satisfying(lambda x: np.abs(x[2] - c["H"]) < 1e-6, boundaries_only=True))
f = fe.LinearForm(lambda v, w: -P * v[2]).assemble(fb)
ta = time.perf_counter()
D = ib.get_dofs(lambda x: np.abs(x[2] + 200) < 1e-6).all()
if how == "spsolve":
    u = fe.solve(*fe.condense(K, f, D=D))
elif how == "cg":
    u = fe.solve(*fe.condense(K, f, D=D), solver=fe.solver_iter_pcg(rtol=1e-10))
else:
    from pypardiso import spsolve
    A, b, x, I = fe.condense(K, f, D=D)
    u = x.copy(); u[I] = spsolve(A.tocsr(), b)
ts = time.perf_counter()
U = u[ib.nodal_dofs].T
if nodes_file:                            # the nodes of the interface belong to both blocks
    low, up = np.unique(cl), np.unique(cu)
    np.savez(nodes_file, points=np.vstack([xyz[low], xyz[up]]), u=np.vstack([U[low], U[up]]),
             upper=np.r_[np.zeros(len(low), bool), np.ones(len(up), bool)])
print(json.dumps(dict(solver="skfem " + how, case=c["name"], ndof=int(K.shape[0]), nnz=int(K.nnz), t_import=timp, t_mesh_basis=tm - t0,
      t_assembly=ta - tm, t_solve=ts - ta, wall=ts - t00, rss_MB=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
      **{"uz_" + k: float(U[i, 2]) for k, i in nm.items()})))
