# shellcheck shell=bash
# Sourced: finds Python 3.11 or newer that can make virtual environments.
. .ci/packages.sh

new_enough() { command -v "$1" >/dev/null && "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }

# find_python: prints $PYTHON, or the first of python3, python3.14 … python3.11 that is new enough; else an error and its remedy.
find_python() {
  local candidate found
  [ -n "${PYTHON:-}" ] || command -v python3 >/dev/null || install_packages python3 python3-venv >&2 || true
  for candidate in ${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do
    if new_enough "$candidate"; then
      echo "$candidate"
      return
    fi
  done
  found=$("${PYTHON:-python3}" --version 2>/dev/null || echo "no ${PYTHON:-python3}")
  echo "regolithd needs Python 3.11 or newer; here is $found." >&2
  echo "Remedy: install one (Debian 12: apt-get install python3 python3-venv; Ubuntu 22.04: python3.11 python3.11-venv)," >&2
  echo "      or name one: make … PYTHON=/path/to/python3.12" >&2
  return 1
}

# need_venv PYTHON: Debian has ensurepip in a separate package, named after Python's version.
need_venv() {
  local package
  "$1" -c 'import ensurepip, venv' 2>/dev/null && return
  package=$("$1" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
  install_packages "$package" || {
    echo "$1 cannot make virtual environments. Remedy: sudo apt-get install $package" >&2
    return 1
  }
}
