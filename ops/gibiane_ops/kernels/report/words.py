"""Words of a report that no script gives: buttons, hints, the page on the environment."""

from __future__ import annotations

LANGUAGES = ("en", "fr")

FRENCH = {
    "sort": "trier",
    "click: hide or show": "clic : cacher ou montrer",
    "chart": "graphique",
    "on the Pareto front": "sur le front de Pareto",
    "field": "champ",
    "fit": "ajuster",
    "the whole object": "l'objet entier",
    "seen along x": "vu selon x",
    "seen along -y": "vu selon -y",
    "seen from above": "vu de dessus",
    "seen from below": "vu de dessous",
    "edges": "arêtes",
    "see through": "voir à travers",
    "displacements": "déplacements",
    "amplification": "amplification",
    "drag: turn · click, then wheel: zoom · right button: move · pointer: values": "glisser : tourner · cliquer, "
    "puis molette : grossir · bouton droit : déplacer · pointeur : valeurs",
    "length": "longueur",
    "element": "élément",
    "nearest corner: node": "sommet le plus proche : noeud",
    "in the element": "dans l'élément",
    "here": "ici",
    "at the node": "au noeud",
    "Pareto front (dashed), by increasing abscissa:": "Front de Pareto (tirets), par abscisse croissante :",
    "This report needs JavaScript, which is inside this file; nothing is fetched from a network.": "Ce rapport a "
    "besoin de JavaScript, qui est dans ce fichier ; rien ne vient d'un réseau.",
    "Environment": "Environnement",
    "What": "Quoi",
    "Value": "Valeur",
    "What this report was made with: measured times hold for this machine.": "Avec quoi ce rapport a été fait : les "
    "temps mesurés valent pour cette machine.",
    "Date (UTC)": "Date (UTC)",
    "System": "Système",
    "Processor": "Processeur",
    "Cores": "Coeurs",
    "Memory": "Mémoire",
    "unknown": "inconnu",
    "not installed": "non installé",
}
"""French of each word, by its English."""


def said(text: str, language: str) -> str:
    """Give a word in a language.

    Parameters
    ----------
    text : str
        In English, one of `FRENCH`.
    language : {'en', 'fr'}

    Returns
    -------
    str
    """
    return FRENCH[text] if language == "fr" else text
