// SPDX-FileCopyrightText: 2026 TetFlora Authors
// SPDX-License-Identifier: GPL-3.0-or-later
void main() {
  fragColor = vec4(linear, 1.0);
}
