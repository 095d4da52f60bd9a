"""The mission file to start from: every key with its unit, its default and what it means."""

TEMPLATE = """\
# A survey by a team of robots. Check it: maipp survey FILE --check. Plan it: maipp survey FILE --out DIR.
# Lengths are metres, speeds metres per second, values in the quantity's unit. Paths are relative to this file.

name: lake                       # what route files and figures are titled with

# Where. A file of polygons (GeoJSON, KML, KMZ, GPX, QGroundControl .plan, GeoPackage or Shapefile; holes are islands),
# GeoJSON inline, a list of positions around the border, or the cells of a gridded map: {raster: FILE, below: 0}.
# Positions are [longitude, latitude] in degrees (WGS84), or [x, y] in metres with `metres: true`.
area: [[4.7300, 52.2400], [4.7460, 52.2400], [4.7480, 52.2460], [4.7400, 52.2500], [4.7300, 52.2480]]
# metres: false
# crs: EPSG:25833                # coordinate reference system of positions in this file that are not WGS84
no_go:                           # zones that no robot may enter, in any of these forms
  - [[4.7370, 52.2440], [4.7390, 52.2440], [4.7390, 52.2455], [4.7370, 52.2455]]
clearance_m: 5                   # distance to keep from the border and the zones (default 0)
# ashore_m: 5                    # how far outside starts and ends may lie, as on a pier; they are moved inside

# The team. The start lies in the area or on its border. Give budget_m or budget_minutes.
robots:
  - {name: boat-1, start: [4.7302, 52.2402], speed: 1.5, budget_m: 2500}
  - {name: boat-2, start: [4.7306, 52.2402], speed: 1.2, budget_minutes: 40, end: start, reserve: 20 %}
# end: where a robot ends, start, a position, or a list of which any will do (default anywhere); the way is around zones
# reserve: 20 %                  # what of its budget is not spent; or reserve_m: 500, reserve_minutes: 10 (default 0)
measurement_spacing_m: 100       # distance travelled between two measurements
# communication_range_m: 500     # how far robots hear each other (default: at any distance)

# What. Without a threshold every place matters alike.
quantity: chlorophyll
unit: ug/L
threshold: 12                    # values above 12 ug/L matter
# below: true                    # values below it do
# noise: 0.5                     # standard deviation of a measurement (default: fitted, or 5 % of std)

# What is known before: old measurements, from which mean, spread and length scale are fitted...
# samples: {file: samples.csv, x: longitude, y: latitude, value: chlorophyll}
# samples: {file: sonde.csv, value: chlorophyll, track: boat.gpx, offset_s: 0}
kernel:                          # ... or given here; what is given wins over the fit
  length_scale_m: 300            # distance over which values stay alike
  mean: 9
  std: 4
  # adapt: true                  # live: refitted to what is measured (default: if neither samples nor kernel are given)

# gate: 5                        # live: how surprising a measurement may be, in standard deviations; 0 takes all

# vehicle: boat                  # whom route files are for; or {kind: copter, altitude_m: 20, autopilot: px4}

# How (`maipp planners` lists the planners and their options).
planner: receding-horizon
# planner_options: {joint: true}
# scenario: {grid: 30}           # other settings: grid, nodes, neighbours, beta, interest_rule, belief_capacity, ...
# rehearsal: {fields: 30}        # for --rehearse: fields drawn from what is known, or {raster: FILE}
seed: 0
"""
