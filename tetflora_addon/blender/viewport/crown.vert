// SPDX-FileCopyrightText: 2026 TetFlora Authors
// SPDX-License-Identifier: GPL-3.0-or-later
void main() {
  float side = sqrt(max(1.0 - view.y * view.y, 0.0)), wide = max(form.z, form.w) * look.a;
  gl_Position = matrix * vec4(pos + vec3(0.0, 0.0, 0.5 * form.y), 1.0);
  float tall = 0.5 * side * form.y + view.y * wide, half_size = max(max(tall, wide), 1e-6);
  pixels = 2.0 * half_size * view.x / max(gl_Position.w, 1e-6);
  gl_PointSize = max(pixels, 1.5);
  if (form.y > eye.w * distance(pos, eye.xyz)) {  // it has faces
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  }
  color = pow(look.rgb, vec3(2.2));
  shape = vec4(tall, form.z * look.a, form.w * look.a, 0.012 * form.y) / half_size;
  low = clamp(form.x / max(form.y, 1e-6), 0.0, 0.95);
}
