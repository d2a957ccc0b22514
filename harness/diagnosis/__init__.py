"""Why a renderer is off: which of the known causes explains what was measured of it, and how well.

Each cause is a forward model: the closed forms with one rule exchanged (`worlds`). Its parameters
are fitted to the measured rays and light (`fit`), and the causes are held against each other
(`choose`), for one case and for a whole run (`whole_run`).
"""
