"""The tables of `results.sqlite`, what changed between versions, and the view that rates runs.

See docs/how-to/benchmarks.md.
"""

from optiplan.runs.run import SMALLEST_BOUND

SCHEMA_VERSION = 2
"""Counted up with every change of a table that readers can notice."""

ADDED = {2: {"goal_bound": "REAL", "plan_cpu": "REAL", "optiplan": "TEXT", "code": "TEXT", "improvements": "TEXT"}}
"""Columns of `runs` that came with a version: results of earlier releases get them, empty, when they are opened."""

SCHEMA = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE sessions (
    session INTEGER PRIMARY KEY, started_at TEXT NOT NULL, ended_at TEXT, how TEXT, workers TEXT NOT NULL,
    machine TEXT NOT NULL, versions TEXT NOT NULL);
CREATE TABLE planners (label TEXT PRIMARY KEY, position INTEGER NOT NULL, name TEXT NOT NULL, options TEXT NOT NULL);
CREATE TABLE problems (
    id TEXT PRIMARY KEY, position INTEGER NOT NULL, set_name TEXT NOT NULL, difficulty TEXT, hash TEXT NOT NULL,
    data TEXT NOT NULL, origin TEXT NOT NULL);
CREATE TABLE trajectories (sha256 TEXT PRIMARY KEY, data BLOB NOT NULL);
CREATE TABLE runs (
    problem TEXT NOT NULL REFERENCES problems (id), planner TEXT NOT NULL REFERENCES planners (label),
    seed INTEGER NOT NULL, repetition INTEGER NOT NULL, set_name TEXT NOT NULL, difficulty TEXT,
    planned INTEGER NOT NULL, timed INTEGER NOT NULL, verified INTEGER NOT NULL, executed INTEGER,
    plan_time REAL, verify_time REAL, duration REAL, lower_bound REAL, goal_bound REAL,
    failure_kind TEXT, failure_detail TEXT, witness TEXT, metrics TEXT NOT NULL, timings TEXT NOT NULL,
    info TEXT NOT NULL, improvements TEXT, cut_short INTEGER NOT NULL, trajectory TEXT REFERENCES trajectories (sha256),
    output TEXT NOT NULL, plan_cpu REAL, cpu_time REAL, memory REAL, wall_time REAL, worker TEXT NOT NULL, load REAL,
    started_at TEXT NOT NULL, optiplan TEXT, code TEXT,
    session INTEGER NOT NULL REFERENCES sessions (session),
    PRIMARY KEY (problem, planner, seed, repetition));
"""

VIEW = f"""
CREATE TEMP VIEW rated AS
WITH known AS (
    SELECT problem, lower_bound AS bound FROM runs WHERE verified AND lower_bound IS NOT NULL
    UNION ALL SELECT problem, goal_bound FROM runs WHERE goal_bound IS NOT NULL),
bounds AS (SELECT problem, min(bound) AS bound FROM known GROUP BY problem)
SELECT {{columns}}, bounds.bound AS problem_bound,
    CASE WHEN bounds.bound >= {SMALLEST_BOUND} THEN runs.duration / bounds.bound END AS ratio
FROM runs LEFT JOIN bounds ON bounds.problem = runs.problem
"""
"""`rated`: the runs with one bound for each problem, the least over the end configurations that verified runs reached
and those that the problem lists, s; and `ratio`, duration / that bound."""

ABSORB_PROBLEMS = """
INSERT OR IGNORE INTO problems SELECT id, position + ?, set_name, difficulty, hash, data, origin
FROM other.problems ORDER BY position
"""
ABSORB_PLANNERS = """
INSERT OR IGNORE INTO planners SELECT new, position + ?, name, options
FROM other.planners JOIN labels ON old = label ORDER BY position
"""
ABSORB_SESSIONS = """
INSERT INTO sessions SELECT session + ?, started_at, ended_at, how, workers, machine, versions FROM other.sessions
"""
ABSORB_RUNS = """
INSERT OR IGNORE INTO runs ({columns}, planner, session)
SELECT {columns}, new, session + ? FROM other.runs JOIN labels ON old = other.runs.planner
"""
"""Copy the tables of an attached database `other`; table `labels` (old, new) names its planners."""
