#version 330 core
out float facet;  // counted from 1; 0 is the background; exact up to 2^24

void main()
{
    facet = float(gl_PrimitiveID + 1);
}
