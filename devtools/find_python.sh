#!/bin/sh
# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Prints the first Python that has one of the wanted versions: find_python.sh 3.13 3.11
# PYTHON=... names one instead. Each candidate is run, because the shims of pyenv exist for versions that do not.

works() {
  [ "$("$1" -c 'import ensurepip, ssl, sys, venv; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)" = "$2" ]
}

for version in "$@"; do
  if [ -n "${PYTHON:-}" ]; then
    works "$PYTHON" "$version" && { echo "$PYTHON"; exit 0; }
    continue
  fi
  for candidate in "python$version" python3 python \
    "${PYENV_ROOT:-$HOME/.pyenv}"/versions/"$version".*/bin/python; do
    works "$candidate" "$version" && { echo "$candidate"; exit 0; }
  done
done

{
  if [ -n "${PYTHON:-}" ]; then
    echo "PYTHON=$PYTHON does not run as Python $(echo "$*" | sed 's/ / or /g') with the modules venv and ensurepip."
  else
    echo "No Python $(echo "$*" | sed 's/ / or /g') was found, neither in PATH nor among the versions of pyenv."
  fi
  echo "Blender's wheel (bpy) exists for exactly these: 5.2 wants Python 3.13, 4.5 wants 3.11."
  echo "Install one (for instance: pyenv install 3.13), or name it: make PYTHON=/path/to/python3.13 ..."
} >&2
exit 1
