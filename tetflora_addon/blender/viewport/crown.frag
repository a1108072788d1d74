// SPDX-FileCopyrightText: 2026 TetFlora Authors
// SPDX-License-Identifier: GPL-3.0-or-later
void main() {
  float x = abs(2.0 * gl_PointCoord.x - 1.0), y = (1.0 - 2.0 * gl_PointCoord.y) / shape.x;
  float t = (0.5 * y + 0.5 - low) / (1.0 - low);
  float wide = t < 0.25 ? shape.y * t / 0.25 : mix(shape.y, shape.z, min((t - 0.25) / 0.4, 1.0));
  wide = t > 0.65 ? shape.z * (1.0 - t) / 0.35 : wide;
  wide = mix(max(wide, shape.w), max(shape.y, shape.z) * sqrt(max(1.0 - y * y, 0.0)), view.y);
  if (pixels > 3.0 && (abs(y) > 1.0 || x > wide)) {
    discard;
  }
  float shone = mix(0.6, 0.95, clamp(t + view.y, 0.0, 1.0));
  // Linear, which the viewport's buffer encodes: a power of 2.2 of what is shone, by a polynomial, as pixels are many.
  fragColor = vec4(shone * shone * (0.754 + 0.248 * shone) * color, 1.0);
}
