"""French sentences of curves, curved surfaces, fillets and other late comers of the mesh operators."""

GEOMETRY: dict[str, str] = {
    "curved surfaces exist in three dimensions only": "les surfaces courbes n'existent qu'en trois dimensions",
    "OPTI DIME 3 ELEM TRI3 ;": "OPTI DIME 3 ELEM TRI3 ;",
    "this end is at {gap} from the end of the curve": "ce bout est à {gap} de celui de la courbe",
    "at least two POINT are wanted: the coefficients of 1 and of u": "il faut au moins deux POINT : les coefficients de 1 et de u",
    "the radius is too large: the arc would touch the line at {cut} from the corner, it is {length} long": "le rayon est trop grand : l'arc toucherait la ligne à {cut} du coin, elle est longue de {length}",
    "the two lines are on one line: there is no corner to round": "les deux lignes sont sur une même droite : il n'y a pas de coin à arrondir",
    "the second line does not begin where the first one ends": "la seconde ligne ne commence pas où finit la première",
    "they must share that point: the same POINT, or ELIM; INVE turns a line over": "elles doivent avoir ce point en commun : le même POINT, ou ELIM ; INVE retourne une ligne",
    "a radius is a length: {value} cannot be one": "un rayon est une longueur : {value} n'en est pas une",
    "CONG 'DOUBLE' is not available": "CONG 'DOUBLE' n'est pas disponible",
    "two arcs of CERC make it": "deux arcs de CERC le font",
    "this line is not straight": "cette ligne n'est pas droite",
    "CONG rounds the corner between straight lines": "CONG arrondit le coin entre des lignes droites",
    "elements {shapes} cannot be joined to a point here": "des éléments {shapes} ne peuvent pas être reliés à un point ici",
    "POI1, SEG2 and in space TRI3 and QUA4 can; CHAN 'LINEAIRE' drops mid-nodes": "POI1, SEG2 et, dans l'espace, TRI3 et QUA4 le peuvent ; CHAN 'LINEAIRE' ôte les noeuds milieux",
}
