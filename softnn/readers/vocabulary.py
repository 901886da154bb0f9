"""What columns and header lines are called, in some twenty languages, by pattern.

Names are compared without accents, case and units. A pattern says what a name *may*
be; the unit decides: `Dehnung [mm]` is a length, `Dehnung [%]` a strain.
"""

from __future__ import annotations

import re
import unicodedata
from types import MappingProxyType

from softnn.readers.units import repair

# Columns that carry one of the words below but are another quantity.
_NOT = re.compile(
    r"\b((?<!sample )rates?|speed|velocity|counts?|cycles?|number|nr|max(imum)?|"
    r"min(imum)?|mean|"
    r"torque|sd|std|stdev|deviation|standard error|sem|variance|cov|"
    r"simulat\w*|predict\w*|fit(ted)?|"
    r"rotation|rotary|width|lateral|transverse|quer\w*|breiten\w*|largeur|"
    r"^dat(e|um)$|set ?point|command|target|soll\w*|error|modul\w*|energy|work|"
    r"power|video time|dyn|cont|(?<!from )preload|vorkraft|tenacity|index|marker|"
    r"encoder|"
    r"frequency|phase|pip|day|remaining|load cell (?!\d)\w+|oscillation|amplitude|"
    r"final|"
    r"bruch|break|area|flow|at|yield|peak|offset)\b"
)

# The size of the specimen itself, or of what holds it, as it is at each moment.
_HEIGHTS = (
    r"^(gap|size|height|hohe|hauteur|altura|altezza|thickness|dicke|length|lange)$|"
    r"^[hlHL]$|"
    r"\b(specimen|sample|current|actual|instantaneous|proben\w*) ?"
    r"(length|height|thickness|hohe|lange|dicke)\b|\bproben(hohe|lange|dicke)\b|"
    r"\b(grips?|jaws?|clamps?|plates?|platens?)( to \w+)? (separation|distance|gap)\b|"
    r"\b(separation|gap) (of|between)\b"
)
# A ratio of lengths, 1 where the specimen is not strained.
_STRETCH = (
    r"\b(stretch|lambda|streckung|verstreckung|etirement)\b|^\u03bb|^l l0$|"
    r"\b(extension|elongation|deformation|draw|stretch\w*) ratio\b|"
    r"\b(dehnungs|streck)verhaltnis\b"
)

# Words of travel in mm and of strain in per cent, by their unit.
_LONGER = (
    r"wydluzenie|prodlouzeni|protazeni|predlzenie|raztezek|istezanje|nyulas|megnyulas|"
    r"uzama|alungire|\u0443\u0434\u043b\u0438\u043d\u0435\u043d\u0438\u0435"
)

# Components of a strain field, by the software of cameras.
_TENSOR = r"^(e|eps|epsilon|\u03b5) ?(xx|yy|zz|x|y|z|11|22|33|1|2)\b"
# The direction of a strain, where its name ends in one.
DIRECTION = re.compile(
    r"^(?:e|eps|epsilon|\u03b5|.*\bstrain) ?(xx|yy|zz|x|y|z|11|22|33)\b|"
    r"^(?:f|force|load|kraft) ?([xyz])\b"
)
# Lines of a header that say which axis was loaded, and moved.
AXIS = re.compile(r"\b(axis|achse|axe|asse|eje|channel|kanal)\b")
LOADED = re.compile(r"\b(load|force|kraft)\b")
MOVED = re.compile(r"\b(stage|motion|position|displacement|travel|weg|crosshead)\b")

# What the machine was told, beside what it measured: taken only where it stands alone.
SET = re.compile(
    r"\b(set( ?values?)?|cmd|commanded|demand\w*|ref(erence)?|"
    r"nominal (position|disp\w*)|programmed|vorgabe|sollwert|consigne|zadana?)\b"
)

# role -> patterns, most wanted first. \u escapes are Chinese and Japanese words.
_ROLES = {
    "time": (
        r"^(total|test|elapsed|running|run|global)? ?time\b(?!.*\bof\b)|"
        r"\b(pru?e?f|versuchs|mess|test|gesamt)?zeit\b|^(sec|secs|seconds|s|t)$|"
        r"^(millis|micros|milliseconds|minutes)$|"
        r"\b(temps|duree|tiempo|tempo|tijd|tid|czas|cas|ido|vrijeme|zaman|timp|aika)\b|"
        r"\b(\u0432\u0440\u0435\u043c\u044f)\b|^elapsed$|^seconds since\b|"
        "\u65f6\u95f4|\u6642\u9593",
        r"\bstep time\b|\bsegment time\b",
        r"\btime ?stamp\b|\bzeitstempel\b|\bdate ?time\b|\bdatum ?\w* zeit\b|"
        r"\b(horodatage|epoch|uhrzeit|heure|hora|ora|godzina|hodina|saat|tijdstip|"
        r"klockslag|klokkesl\u00e6t)\b|^clock$|^T$|"
        "\u65f6\u523b|\u6642\u523b",
    ),
    "force": (
        r"\b(standard ?)?(force|kraft|standardkraft|pru?e?fkraft|zugkraft)\b|"
        r"\b(load|last|charge|effort|fuerza|carga|forza|carico|kracht|forca|"
        r"sila|obciazenie|zatizeni|zatazenie|ero|terheles|kuvvet|yuk|forta|voima)\b|"
        r"\b(\u0441\u0438\u043b\u0430|\u0443\u0441\u0438\u043b\u0438\u0435|"
        r"\u043d\u0430\u0433\u0440\u0443\u0437\u043a\u0430)\b|^[fF]( stat)?$|"
        "(?<![\u5e94\u61c9\u5fdc\u538b])\u529b|\u8f7d\u8377|\u8377\u91cd|\u8d1f\u8377",
        r"^f ?(n|x|y|z|ax|axial|normal)\b|^[Pp]$|^(load ?cell|loadcell|lc)( ?\d)?$",
        r"^(weight|gewicht|mass|masse|poids|peso)$",
    ),
    "stress": (
        r"\b(eng\w*|nominal|tensile|compressive)\b.*\bstress\b",
        r"\b(stress|spannung|\w+spannung|contrainte|esfuerzo|sforzo|tensao|spanning|naprezenie|tensione?|sigma|sig|"
        r"napeti|napatie|napetost|naprezanje|feszultseg|gerilme|tensiune|jannitys|"
        r"\u043d\u0430\u043f\u0440\u044f\u0436\u0435\u043d\u0438\u0435|pk ?[12])\b|"
        "\u03c3|[\u5e94\u61c9\u5fdc]\u529b",
        r"^[PpSs]( ?1?1)?$",
    ),
    "strain": (
        r"\b(eng\w*|nominal|tensile|compressive)\b.*\bstrain\b",
        r"\b(strain|dehnung|stauchung|verformung|deform\w*|epsilon|eps|rek|tojning|"
        r"odksztalcenie|pretvorenie|deformacija|gerinim|venyma|"
        r"\u0434\u0435\u0444\u043e\u0440\u043c\u0430\u0446\u0438\u044f)\b|"
        "^\u03b5|"
        "[\u5e94\u61c9]\u53d8|\u3072\u305a\u307f|\u6b6a\u307f",
        r"\b(elongation|allongement|extension|alargamiento|allungamento|ave)\b|"
        r"\b(\w*verlangerung|estensione|" + _LONGER + r")\b|\u4f38\u957f|\u5ef6\u4f38",
        _STRETCH,
        r"^e$|" + _TENSOR,
    ),
    "displacement": (
        r"\b(standardweg|standard travel|course standard|recorrido estandar)\b",
        r"\b(displacement|extension|elongation|stroke|displ?|elong|ext|travel|weg|way)\b|"
        r"\b(deplacement|course|allongement|\w*verlangerung|\w+weg)\b(?!.*absolut)|"
        r"\b(desplazamiento|carrera|alargamiento|spostamento|corsa|allungamento)\b|"
        r"\b(langenanderung|estensione|delta l|dl|verplaatsing|deslocamento|"
        r"forlangning|przemieszczenie|droga|draha|posun|posuv|pomik|pomak|"
        r"elmozdulas|deplasare|siirtyma|\u043f\u0435\u0440\u0435\u043c\u0435\u0449\u0435\u043d\u0438\u0435|"
        + _LONGER
        + r")\b|^\u03b4 ?[lhsxd]$|"
        "\u4f4d\u79fb|\u884c\u7a0b|\u4f38\u957f|\u5ef6\u4f38|\u5909\u4f4d|\u30b9\u30c8\u30ed\u30fc\u30af",
        r"\bcrosshead\b(?!.*absolut)|\btravers\w*\b(?!.*absolut)",
        r"\b(position|pos|gap|size|hub|height)\b|\babsol\w*\b",
        r"\b(distance|deflection|indentation|penetration|compression|stretch|move\w*|"
        r"durchbiegung|eindring\w*|distanz|fleche|enfoncement)\b|^(d|u|x|z|s) ?(mm)?$",
        _HEIGHTS,
        r"\b(capteur|dehnung|stauchung|verformung|deform\w*|extensometer|lvdt|strain)\b|\u53d8\u5f62",
    ),
    "temperature": (r"^T$|\btemp(erat\w*)?\b|\u6e29\u5ea6", r"^t$"),
}
ROLES = MappingProxyType(
    {role: tuple(map(re.compile, patterns)) for role, patterns in _ROLES.items()}
)
DIMENSION = MappingProxyType(
    {
        "time": "time",
        "force": "force",
        "stress": "stress",
        "strain": "strain",
        "displacement": "length",
        "temperature": "temperature",
    }
)

# Columns whose zero is the machine's, not the specimen's.
ABSOLUTE = re.compile(
    r"\babsol\w*\b|\b(position|pos)\b|^(gap|size|height)\b|"
    r"\bcapteur de course|" + _HEIGHTS
)
HEIGHT = re.compile(r"^(gap|size|height)\b|" + _HEIGHTS)
STRETCH = re.compile(_STRETCH)
REMARK = re.compile(
    r"\b(comments?|remarks?|notes?|events?|markers?|status|kommentar|bemerkung\w*|"
    r"commentaires?|comentarios?|commenti|message)\b"
)
# Travel that is measured on the specimen, beside that of the machine.
GAUGE = re.compile(r"\b(lvdt|extensometer|laser|video|dic|gau?ge|aufnehmer)\b")
STEP_CLOCK = re.compile(r"\b(step|segment) time\b")
COMPRESSIVE = re.compile(
    r"\bcompressi(ve|on)\b|\bdruck(kraft|spannung)\b|\bstauchung\b|\u538b\u7f29"
)

# A line of a header that says how the specimen is loaded, and what it then says.
TEST_KIND = re.compile(r"^(test |loading )?(type|mode|kind|direction)( of test)?$"
                       r"|^test$|^pr\u00fcf(art|richtung)$|^versuchsart$")  # fmt: skip
PRESSED = re.compile(r"^((uni)?axial )?(compressi(ve|on)|druck)( ?test|versuch)?$")

GEOMETRY = MappingProxyType(
    {
        field: re.compile(pattern)
        for field, pattern in {
            "area_mm2": r"\b(cross )?section(al)?( area)?\b|\barea\b|\bquerschnitt\w*|"
            r"^s0$|^a0 area$|\bseccion\b|\bsezione\b|\baire\b|\u9762\u79ef|"
            r"\b(przekroj\w*|prurez\w*|prierez\w*|presek|presjek|doorsnede|"
            r"dwarsdoorsnede|oppervlakte?|tvarsnitt\w*|tv\u00e6rsnit\w*|poikkipinta\w*|"
            r"keresztmetszet|kesit( alani)?|aria|arie|seccao|secao|"
            r"\u043f\u043b\u043e\u0449\u0430\u0434\u044c|"
            r"\u0441\u0435\u0447\u0435\u043d\u0438\u0435)\b|\u65ad\u9762\u7a4d",
            "thickness_mm": r"\bthickness\b|dicke\b|\bepaisseur\b|\bespesor\b|"
            r"\bspessore\b|^a0$|\u539a\u5ea6|"
            r"\b(grubosc|tloustka|hrubka|dikte|espessura|tjocklek|tykkelse|tykkelsen|"
            r"vastagsag|kalinlik|grosime|paksuus|debljina|debelina|"
            r"\u0442\u043e\u043b\u0449\u0438\u043d\u0430)\b|\u539a\u3055",
            "width_mm": r"\bwidth\b|breite\b|\blargeur\b|\bancho\b|\banchura\b|"
            r"\blarghezza\b|^b0$|\u5bbd\u5ea6|"
            r"\b(szerokosc|sirka|breedte|largura|bredd|bredde|szelesseg|genislik|latime|"
            r"leveys|sirina|\u0448\u0438\u0440\u0438\u043d\u0430)\b|\u5e45",
            "diameter_mm": r"\bdiameter\b|durchmesser\b|\bdiametre\b|\bdiametro\b|"
            r"^d0$|\u76f4\u5f84|"
            r"\b(srednica|prumer|priemer|atmero|cap|diametru|halkaisija|promjer|premer|"
            r"\u0434\u0438\u0430\u043c\u0435\u0442\u0440)\b",
        }.items()
    }
)
# Lines that may give the length strain refers to, the surest first: a header may hold
# the whole specimen's length beside its gauge length.
LENGTHS = tuple(
    map(
        re.compile,
        (
            # Zwick: what belongs to the standard travel, before other gauge lengths
            r"\b(standard travel|standardweg|course standard)\b",
            r"\bgau?ge length\b|\bmesslange\b|^l ?[0co]\b|\bausgangslange\b|"
            r"\b(initial|original) length\b|\blongueur (de base|initiale|utile)\b|"
            r"\blongitud (calibrada|inicial)\b|\blunghezza (utile|iniziale)\b|"
            "\u6807\u8ddd|\u521d\u59cb\u957f\u5ea6",
            r"\b(grips?|jaws?|clamps?)( to \w+)? (separation|distance|spacing)\b|"
            r"\beinspannlange\b|\bversuchslange\b|\bfree length\b|"
            r"\bdistance (between|entre)\b|\bdistan(cia|za) (entre|tra)\b|\u5939\u5177",
            r"\b(specimen|sample|clamp|test) length\b|^length\b|\bheight\b|\bhohe\b|"
            r"\bprobenlange\b|\blongueur\b|\bhauteur\b|\blongitud\b|\baltura\b|"
            r"\blunghezza\b|\baltezza\b|\u957f\u5ea6|\u9ad8\u5ea6|\u9577\u3055|"
            r"\b(dlugosc|wysokosc|delka|vyska|dlzka|lengte|hoogte|comprimento|langd|"
            r"l\u00e6ngde|lengde|hossz|magassag|uzunluk|yukseklik|lungime|inaltime|pituus|"
            r"korkeus|duzina|dolzina|visina|\u0434\u043b\u0438\u043d\u0430|"
            r"\u0432\u044b\u0441\u043e\u0442\u0430)\b",
        ),
    )
)
NOT_GEOMETRY = re.compile(
    r"\b(final|end|break|bruch|change|after|unit|path|wave|cable|compensation|"
    r"reduction|max|min|maximum|constant|load cell|calibration|plate|rollers?|inner|"
    r"outer|correction|factor|total|beam|span|innen\w*|aussen\w*)\b"
)
SPEED = re.compile(
    r"\bspeed\b|\brate( 1)?\b|geschwindigkeit\b|\bvitesse\b|\bvelocidad\b|\bvelocita\b|"
    r"^v ?\d$|\u901f\u5ea6"
)
# The speed of the test itself, where the header also has those of its phases.
TEST_SPEED = re.compile(
    r"^(test|crosshead) speed\b|\bprufgeschwindigkeit\b|^rate 1$|^vitesse d essai\b"
)
SPECIMEN = re.compile(
    r"\b(specimen|sample) (label|name|id|designation|identification)\b|^test run\b|"
    r"\bproben(kennung|bezeichnung|name)\b|\bdesignation\b|^nom (de l )?eprouvette|"
    r"\bnombre de (la )?probeta\b|\u8bd5\u6837"
)
# A column that says of each row which specimen it is of; which test, if the clock
# starts again there.
WHOSE = re.compile(
    r"^(specimen|sample|probe|probekorper|prufkorper|eprouvette|probeta|provino)"
    r"( (id|no|nr|name|number|label|num))?$"
)
WHICH = re.compile(r"^(test|run|trial|experiment|curve|versuch|essai|ensayo|file|id)"
                   r"( (id|no|nr|name|number))?$")  # fmt: skip
MATERIAL = re.compile(
    r"^(material|werkstoff|matiere|materiau|materiale|material name)$|\u6750\u6599"
)


# Letters with a stroke or without a dot, which are no letter with an accent.
_STROKES = str.maketrans("\u0142\u0141\u00f8\u00d8\u0111\u0110\u0131", "lLoOdDi")


def plain(name: str) -> str:
    """A name as the patterns expect it: lower case, no accents, no punctuation.

    >>> plain("Pr\u00fcfzeit"), plain("Tensile strain (Extension)"), plain("TestTime")
    ('prufzeit', 'tensile strain extension', 'test time')
    """
    name = re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", " ", repair(name))
    name = unicodedata.normalize("NFKD", name.replace("\u00df", "ss"))
    name = re.sub("[\u0300-\u036f]", "", name)  # accents; Japanese marks stay
    name = name.translate(_STROKES)
    letter = name.strip()[:1]
    name = unicodedata.normalize("NFC", name).lower()
    name = " ".join(re.sub(r"[^\w]+|_+", " ", name).split())
    # A letter alone keeps its case: t is time where T is temperature.
    return letter if len(name) == 1 and letter.casefold() == name else name


def rank(role: str, name: str) -> int | None:
    """How well a column's plain name fits a role, 0 best; None: not at all.

    >>> rank("time", "total time"), rank("time", "cycle elapsed time")
    (0, None)
    """
    if _NOT.search(name):
        return None
    # WaveMatrix gives a digital position beside the measured one, or alone.
    second = 10 * (re.search(r"\bdigital\b", name) is not None)
    if role in ("displacement", "strain", "force", "stress") and SET.search(name):
        second += 20
    for i, pattern in enumerate(ROLES[role]):
        if pattern.search(name):
            return i + second
    return None
