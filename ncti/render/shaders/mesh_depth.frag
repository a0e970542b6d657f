#version 330 core
flat in float vertex;

out float facet;  // the background is -1; exact up to 2^24

void main()
{
    facet = vertex;
}
