#version 330 core
flat in float vertex;

out float facet;  // counted from 1, 0 being the background; exact up to 2^24

void main()
{
    facet = vertex + 1.0;
}
