// Tables of parameters: KEY(group, type, name, default, least, most, unit, effect), one line for each number. What a
// line makes of itself, given to the table as KEY:
#pragma once

#define STILLMESH_FIELD(group, type, name, value, least, most, unit, effect) type name = value;
#define STILLMESH_VISIT(group, type, name, value, least, most, unit, effect) \
    v(#group "." #name, c.group.name, static_cast<double>(least), static_cast<double>(most), unit, effect);
#define STILLMESH_ASSIGN(group, type, name, value, least, most, unit, effect) group.name = c.group.name;
