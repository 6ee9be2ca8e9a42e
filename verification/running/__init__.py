"""A suite run: each case in a process of its own, its outcome kept in a folder as soon as it is known.

plan = which cases, on how many levels, how long                         (plan)
pool = processes side by side, none of which stops another               (pool)
    worker = one case, in its own process                                (worker)
folder = what is kept of every case, and of all together                 (folder, junit)
"""
