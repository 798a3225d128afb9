"""French sentences: why an estimate of the error bounds it or not, how far a study is."""

ESTIMATION: dict[str, str] = {
    # how figures are to be read
    "relative to the energy norm of the solution and of its error": "rapporté à la norme en énergie de la solution et de son erreur",
    "relative to the norm of smoothed plus computed stress, as in the thesis: about half of the usual figure": "rapporté à la norme de la somme des contraintes lissée et calculée, comme dans la thèse : environ la moitié de la valeur usuelle",
    # why an estimate bounds the error, or not
    "a smoothed stress estimates the error; only an equilibrated stress bounds it": "une contrainte lissée estime l'erreur ; seule une contrainte en équilibre la majore",
    "explicit residuals follow the error up to a factor that depends on the mesh": "les résidus explicites suivent l'erreur à un facteur près, qui dépend du maillage",
    "the true error, up to the integration of the exact stress": "l'erreur vraie, à l'intégration de la contrainte exacte près",
    "a stress in exact equilibrium with the loads: the error is not above this value": "contrainte en équilibre exact avec le chargement : l'erreur ne dépasse pas cette valeur",
    "a stress in exact equilibrium with the loads: the error is not above this value, of which {share} stands for the integration of rational stresses (the difference of two rules)": "contrainte en équilibre exact avec le chargement : l'erreur ne dépasse pas cette valeur, dont une part de {share} couvre l'intégration de contraintes rationnelles (l'écart de deux formules)",
    "the equilibrium is violated by {share} of the tractions": "l'équilibre est violé de {share} des vecteurs contrainte",
    "not guaranteed ({doubt})": "non garanti ({doubt})",
    "Coulomb": "Coulomb",
    "friction law {law}": "loi de frottement {law}",
    "adhesion": "adhésion",
    "the bodies overlap by {depth}": "les corps s'interpénètrent de {depth}",
    "Tresca's bound on pairs that are open, where it jumps to zero": "seuil de Tresca sur des paires ouvertes, où il tombe à zéro",
    "friction does not oppose the slip: does it count from another state, as with 'HIST'?": "le frottement ne s'oppose pas au glissement : est-il compté depuis un autre état, comme avec 'HIST' ?",
    "no contact tractions in balance obey the law: it is left by {size}": "aucun vecteur contrainte de contact en équilibre n'obéit à la loi : il s'en écarte de {size}",
    "quadratic contact facets are open in part, and may overlap between their nodes": "des facettes de contact quadratiques sont ouvertes en partie, et peuvent s'interpénétrer entre leurs noeuds",
    "the contact surface is not plane": "la surface de contact n'est pas plane",
    "nodes of the contact surface have no partner": "des noeuds de la surface de contact n'ont pas de vis-à-vis",
    "thermal or other strains, which no displacement of the elements has, are part of the stress": "des déformations thermiques ou autres, qu'aucun déplacement des éléments ne donne, entrent dans la contrainte",
    "sides of elements are curved: the stress in equilibrium stands on their chords": "des côtés d'éléments sont courbes : la contrainte en équilibre est construite sur leurs cordes",
    "faces of elements are not plane: those of the stress in equilibrium are cut into triangles": "des faces d'éléments ne sont pas planes : celles de la contrainte en équilibre sont coupées en triangles",
    "a load varies more than linearly over the facets of the stress in equilibrium": "une charge varie plus que linéairement sur les facettes de la contrainte en équilibre",
    # studies of ASSI
    "{old} of {total} cases were done before": "{old} cas sur {total} déjà faits",
    "{count} cases to do, about {time} on {workers} process(es)": "{count} cas à faire, environ {time} sur {workers} processus",
    "{done} of {total} cases, {elapsed}, about {left} left": "{done} cas sur {total}, {elapsed}, encore {left} environ",
}
