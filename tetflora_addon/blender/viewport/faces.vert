// SPDX-FileCopyrightText: 2026 TetFlora Authors
// SPDX-License-Identifier: GPL-3.0-or-later
void main() {
  gl_Position = matrix * vec4(pos, 1.0);
  linear = pow(color.rgb, vec3(2.2));  // here, and not for each pixel
}
