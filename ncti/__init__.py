"""Ship identification by laser-radar range profiles: pure functions from ship sheet to score.

Rooms, in the order the data flows: `ships`, `render`, `ladar`, `features`, `classify`,
`evaluate`. A room imports only from rooms before it; `classify` and `evaluate` see plain
arrays and import none of them.
"""
