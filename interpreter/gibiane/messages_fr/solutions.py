"""French sentences: linear solutions, mesh files, archives."""

SOLUTIONS: dict[str, str] = {
    # linear solutions
    "conditions contradict each other at ({where}), by {gap}: {conditions}": "des conditions se contredisent en ({where}), de {gap} : {conditions}",
    "they prescribe different values of the same unknowns: leave one out, or give both the same DEPI": "elles imposent des valeurs différentes aux mêmes inconnues : en retirer une, ou donner à toutes le même DEPI",
    "the system is singular: {count} unknowns can change without force, {which}": "le système est singulier : {count} inconnues peuvent changer sans force, {which}",
    "hold them with BLOQ; parts that share only a node or an edge can turn about it": "les tenir par BLOQ ; des parties qui n'ont en commun qu'un noeud ou une arête peuvent tourner autour",
    "OPTI 'RESO' '{word}' is not available": "OPTI 'RESO' '{word}' n'est pas disponible",
    "'DIRE', 'ITER', or neither": "'DIRE', 'ITER', ou ni l'un ni l'autre",
    "the strain energy of the solution differs from the work of the loads by {gap} of it": "l'énergie de déformation de la solution diffère du travail des charges de {gap} fois celui-ci",
    "the matrix is ill conditioned: very different stiffnesses, flat elements, or a solid barely held": "la matrice est mal conditionnée : raideurs très différentes, éléments plats, ou solide à peine tenu",
    "here the unknowns are {known}; 'DEPL' 'DIRECTION' V takes them along a vector": "ici les inconnues sont {known} ; 'DEPL' 'DIRECTION' V les prend le long d'un vecteur",
    # files
    "the points of {path} have a coordinate beyond the dimension {dim}": "les points de {path} ont une coordonnée au delà de la dimension {dim}",
    "OPTI DIME 3 ; before the first point": "OPTI DIME 3 ; avant le premier point",
    "elements of {path} are left out: {types} are not available here": "des éléments de {path} sont laissés : {types} ne sont pas disponibles ici",
    "the file {path} cannot be read: {reason}": "le fichier {path} ne peut être lu : {reason}",
    "is the format right, and the file whole?": "le format est-il le bon, et le fichier entier ?",
    # archives
    "no file is set": "aucun fichier n'est donné",
    "OPTI '{option}' 'name' ; first": "d'abord OPTI '{option}' 'nom' ;",
    "the name of an object is wanted here": "on attend ici le nom d'un objet",
    "a value without a name has no place": "une valeur sans nom n'a pas de place",
    "a {type} cannot be saved": "un {type} ne peut être sauvé",
    "SAUV with the names of the others": "SAUV avec les noms des autres",
    "there is no object {name}": "il n'y a pas d'objet {name}",
    "the file {path} cannot be restored: {reason}": "le fichier {path} ne peut être restitué : {reason}",
    "REST reads what SAUV has written": "REST lit ce que SAUV a écrit",
    "the file was saved with OPTI DIME {other}, this session has DIME {own}": "le fichier a été sauvé avec OPTI DIME {other}, cette session a DIME {own}",
    "REST before OPTI DIME, or in another session": "REST avant OPTI DIME, ou dans une autre session",
    "the file holds no object {name}": "le fichier ne contient pas d'objet {name}",
    "it holds {known}": "il contient {known}",
}
