"""Limits on what is taken from outside and on the work that it may cause: each number stands here once."""

# an FMU in a process of its own, see fmus/host/apart
CALL = 60.0  # s, that one call of an FMU may take
RUN = 6 * 3600.0  # s, that one simulation may take
MEMORY = 8.0  # GB, that the process of the FMUs may use
LAST_WORDS = 3  # lines that an FMU logged or printed, told when it ended its process

# packages (FMU, SSP) and scenarios
ENTRIES = 20_000  # files in a package
UNPACKED = 2.0  # GB that they have together
STEPS = 20_000_000  # of a simulation of coupled FMUs, which are planned in memory

# files and requests
TEXT = 64.0  # MB of a file that is read as a whole: a profile, a TOML file, a result
COLUMNS = 10_000  # of a record
RECORD = 8.0  # GB that the columns of a record may have in memory, or its text unpacked
READING = 600.0  # s, that a record may take to be read by a library which a damaged one may crash
DRAWS = 10_000  # measurements of a pair by which the reading of points is tested

# the trials of an FMU before it is estimated, see fmus/host/grading/honest.py
RESTARTS = 1e-4  # of an output's size: what a solver with steps of its own may change by a restart
PROBED = 200  # outcomes that are kept

# an interrupt, all of which is over within 5 s
GRACE = 1.5  # s, after which an FMU that does not stop is ended
INTERRUPT = 4  # s, after which a command that does not stop is ended
