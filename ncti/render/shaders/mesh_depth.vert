#version 330 core
layout(location = 0) in vec3 position;

uniform mat4 P;  // from the ship to clip coordinates: projection, view and model in one

flat out float vertex;  // that of the facet's last vertex

void main()
{
    gl_Position = P * vec4(position, 1.0);
    vertex = float(gl_VertexID);
}
