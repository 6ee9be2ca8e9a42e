"""The table of cards: what reads each, with which options; what has no effect here; what lacsolver lacks.

A card that stands in none of the three is refused by its name: nobody knows if the answer hangs on it.
"""

from __future__ import annotations

from collections.abc import Callable

from lacmesh.errors import on_page
from lacsolver.decks import bodies, contact, joints, loads, materials, steps
from lacsolver.decks.cards import Card
from lacsolver.decks.import_ import Import

Handler = Callable[[Import, Card], None]
#: keyword without blanks -> its handler, the options that this takes, and those that have no effect here
HANDLERS: dict[str, tuple[Handler, str, str]] = {
    "ELEMENT": (bodies.element, "TYPE ELSET INPUT", ""),
    "SURFACE": (bodies.surface, "NAME TYPE INSTANCE", "INTERNAL"),
    "MATERIAL": (materials.material, "NAME", ""),
    "ELASTIC": (materials.elastic, "TYPE", ""),
    "HYPERELASTIC": (materials.hyperelastic, "NEOHOOKE", ""),
    "PLASTIC": (materials.plastic, "HARDENING", ""),
    "DENSITY": (materials.density, "", ""),
    "EXPANSION": (materials.expansion, "TYPE ZERO", ""),
    "ORIENTATION": (materials.orientation, "NAME SYSTEM", "DEFINITION"),
    "SOLIDSECTION": (materials.section, "ELSET MATERIAL ORIENTATION", "CONTROLS OFFSET"),
    "AMPLITUDE": (steps.amplitude, "NAME TIME DEFINITION VALUE SHIFTX SHIFTY", "SMOOTH"),
    "INITIALCONDITIONS": (loads.initial_conditions, "TYPE", ""),
    "SURFACEINTERACTION": (contact.interaction, "NAME", ""),
    "SURFACEBEHAVIOR": (contact.behavior, "PRESSURE-OVERCLOSURE", ""),
    "CONTACTDAMPING": (contact.damping, "DEFINITION TANGENTFRACTION", ""),
    "FRICTION": (contact.friction, "ROUGH TAUMAX", "SLIPTOLERANCE ELASTICSLIP LAGRANGE"),
    "CHANGEFRICTION": (contact.change, "INTERACTION", ""),
    "CHANGESURFACEBEHAVIOR": (contact.change, "INTERACTION", ""),
    "CONTACTPAIR": (contact.contact_pair, "INTERACTION TYPE SMALLSLIDING ADJUST", "NAME"),
    "CLEARANCE": (contact.clearance, "MASTER SLAVE VALUE", ""),
    "TIE": (contact.tie, "POSITIONTOLERANCE CYCLICSYMMETRY", "NAME ADJUST TYPE"),
    "CYCLICSYMMETRYMODEL": (joints.cyclic_model, "N TIE", "ELSET NGRAPH CHECK"),
    "EQUATION": (joints.equation, "", ""),
    "MPC": (joints.mpc, "", ""),
    "TRANSFORM": (joints.transform, "NSET TYPE", ""),
    "PRE-TENSIONSECTION": (joints.pretension_section, "SURFACE NODE ELEMENT", "NAME"),
    "COUPLING": (joints.coupling, "REFNODE SURFACE ORIENTATION", "CONSTRAINTNAME"),
    "KINEMATIC": (joints.kinematic, "", ""),
    "DISTRIBUTING": (joints.distributing, "WEIGHTINGMETHOD", "COUPLING"),
    "DISTRIBUTINGCOUPLING": (joints.distributing_coupling, "ELSET", ""),
    "RIGIDBODY": (bodies.rigid_body, "NSET ELSET REFNODE ROTNODE", ""),
    "SPRING": (bodies.spring, "ELSET", ""),
    "STEP": (steps.step, "NLGEOM AMPLITUDE PERTURBATION", "INC INCF NAME EXTRAPOLATION UNSYMM CONVERTSDI"),
    "SELECTCYCLICSYMMETRYMODES": (steps.cyclic_modes, "NMIN NMAX", ""),
    "STATIC": (steps.static, "DIRECT", "SOLVER"),
    "FREQUENCY": (steps.frequency, "", "STORAGE SOLVER EIGENSOLVER NORMALIZATION"),
    "DYNAMIC": (steps.dynamic, "ALPHA DIRECT EXPLICIT", "SOLVER"),
    "DAMPING": (materials.damping, "ALPHA BETA", ""),
    "MASS": (bodies.mass, "ELSET", ""),
    "ROTARYINERTIA": (bodies.rotary_inertia, "ELSET", ""),
    "ENDSTEP": (steps.end_step, "", ""),
    "BOUNDARY": (loads.boundary, "OP AMPLITUDE FIXED TYPE", ""),
    "MODELCHANGE": (contact.model_change, "TYPE ADD REMOVE", ""),
    "CLOAD": (loads.cload, "OP AMPLITUDE TIMEDELAY", ""),
    "DLOAD": (loads.dload, "OP AMPLITUDE TIMEDELAY", ""),
    "DSLOAD": (loads.dsload, "OP AMPLITUDE TIMEDELAY", ""),
    "TEMPERATURE": (loads.temperature, "OP AMPLITUDE", ""),
    "NODEPRINT": (loads.node_print, "NSET", "FREQUENCY FREQUENCYF TOTALS TIMEPOINTS GLOBAL"),
}
#: cards whose data lines are taken one by one, so that each is refused alone
BY_LINE = ("BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE", "INITIALCONDITIONS", "CONTACTPAIR", "TIE")
#: cards that are the mesh, or frames of it: lacmesh has read them
OF_THE_MESH = (
    *("NODE", "NSET", "ELSET", "HEADING", "PART", "ENDPART", "INSTANCE", "ENDINSTANCE", "ASSEMBLY", "ENDASSEMBLY"),
    *("PREPRINT", "RESTART", "INCLUDE"),
)
#: cards that do not change the answer -> what a user may want to know
NOTES = {
    "ELPRINT": "stresses are in the fields (solid.pvd), and their extremes of each group in results.json",
    "CONTACTPRINT": "pressures, gaps, areas and resultants of contact are in contact_NAME.csv and history.csv",
    "SECTIONPRINT": "forces on sections are not computed; reactions and contact resultants are in history.csv",
    **dict.fromkeys(
        ("NODEFILE", "ELFILE", "CONTACTFILE", "OUTPUT", "NODEOUTPUT", "ELEMENTOUTPUT", "CONTACTOUTPUT", "FILEFORMAT"),
        f"a run writes its fields after every step; see [output] in {on_page('case')}",
    ),
    "TIMEPOINTS": "times of results are [output] times in the case",
    "MONITOR": "history.csv has probes and reactions",
    "PRINT": "lacsolver run prints a line for each step",
    **dict.fromkeys(
        ("CONDUCTIVITY", "SPECIFICHEAT", "GAPCONDUCTANCE", "PHYSICALCONSTANTS", "VALUESATINFINITY"),
        "it has no effect on displacements without steps of heat, which lacsolver does not compute",
    ),
    "CONTROLS": "the case has its own [solver] and [steps]",
    "SECTIONCONTROLS": "lacsolver integrates in full, without hourglass modes",
}
_SHELLS = "lacsolver computes solid elements; model this part with them"
_HEAT = "lacsolver computes no heat; give the temperatures by *TEMPERATURE"
#: procedures of steps that lacsolver has not; nobody may leave them out, as a step without one is static
PROCEDURES = dict.fromkeys(
    ("BUCKLE", "MODALDYNAMIC", "STEADYSTATEDYNAMICS", "COMPLEXFREQUENCY", "SENSITIVITY",
     "VISCO", "GREEN", "ELECTROMAGNETICS", "SUBSTRUCTUREGENERATE", "HEATTRANSFER", "COUPLEDTEMPERATURE-DISPLACEMENT",
     "UNCOUPLEDTEMPERATURE-DISPLACEMENT"),
    "lacsolver computes static steps (*STATIC) and implicit ones with inertia (*DYNAMIC)",
)  # fmt: skip
#: cards that change the answer, and that lacsolver has no place for -> what to try
LACKS = {
    **dict.fromkeys(("SHELLSECTION", "MEMBRANESECTION", "BEAMSECTION", "BEAMGENERALSECTION"), _SHELLS),
    **dict.fromkeys(("USERELEMENT", "USERSECTION", "FLUIDSECTION", "GAP", "DASHPOT"), _SHELLS),
    **dict.fromkeys(("CREEP", "CYCLICHARDENING", "HYPERFOAM", "USERMATERIAL", "DEPVAR", "MOHRCOULOMB",
                     "DEFORMATIONPLASTICITY", "VISCOELASTIC"),
                    f"lacsolver has elastic materials and *PLASTIC; {on_page('architecture')} says how to add a law"),
    **dict.fromkeys(("FILM", "DFLUX", "CFLUX", "RADIATE"), _HEAT),
    "GENERALCONTACT": "contact is between named surfaces; write *CONTACT PAIR for each pair",
    "CONTACT": "contact is between named surfaces; write *CONTACT PAIR for each pair",
    "FIELD": "fields other than temperature are not supported",
    "SUBMODEL": "boundary values from another run are not supported; write them as *BOUNDARY",
    "DESIGNVARIABLES": "lacsolver computes no sensitivities; take this out",
    "RETAINEDNODALDOFS": "lacsolver makes no substructures",
}  # fmt: skip
