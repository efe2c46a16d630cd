# shellcheck shell=bash
# Sourced: install_packages NAME…: installs Debian packages if this user may (root or sudo without password), else returns 1.
install_packages() {
  local root=()
  command -v apt-get >/dev/null || return 1
  if [ "$(id -u)" != 0 ]; then
    sudo -n true 2>/dev/null || return 1
    root=(sudo -n)
  fi
  echo "Installing Debian packages: $* …"
  # Package lists first: a fresh machine has none. apt's output is shown only if it fails.
  local log status=0
  log=$(mktemp)
  {
    ${root[@]+"${root[@]}"} apt-get update -qq &&
      ${root[@]+"${root[@]}"} env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@"
  } >"$log" 2>&1 || status=1
  [ "$status" = 0 ] || tail -n 5 "$log" >&2
  rm -f "$log"
  return "$status"
}
