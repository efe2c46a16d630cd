# shellcheck shell=bash
# Sourced by with-vcan and with-systemd: runs a command in User Mode Linux, a Linux kernel that runs as a user process.
#
# The guest's root is this machine's / by hostfs, so that checkout and virtual environment are there at the same paths. The command
# gets this environment (its TMPDIR becomes a tmpfs), this directory, an empty stdin, and this script's stdout and stderr.
#
#   uml_prepare FOLDER COMMAND [ARG…]   writes FOLDER/run: the guest starts it once it is up; it powers the guest off at its end
#   uml_boot FOLDER [KERNEL-ARGUMENT…]  boots with FOLDER/init as process 1, and exits with the command's status
#
# A guest that does not come up ends with 125, one that lasts longer than $GUEST_SECONDS with 124.

die() {
  echo "${0##*/}: $*" >&2
  exit 125
}

# With AMX the guest saves no AVX registers (without_xstate.py): neither the C library, also in the guest's init, nor OpenSSL nor
# numpy may use them.
glibc_without_avx=()
without_avx=()
xstate=()
if grep -qw amx_tile /proc/cpuinfo; then
  xstate=(python3 "$(dirname "${BASH_SOURCE[0]}")/without_xstate.py")
  glibc_without_avx=(
    GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX,-AVX2,-AVX512F,-AVX512VL,-AVX512BW,-AVX_Fast_Unaligned_Load,-XSAVE,-XSAVEC,-ERMS
  )
  without_avx=(
    "${glibc_without_avx[@]}"
    OPENSSL_ia32cap=~0x1000000000000000:~0x600d0230020
    OPENBLAS_CORETYPE=Nehalem
    "NPY_DISABLE_CPU_FEATURES=AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR AVX2 FMA3"
  )
fi

uml_prepare() {
  local folder=$1
  shift
  # NUL-separated, so that any content arrives unchanged.
  env -0 >"$folder/environment"
  [ "${#without_avx[@]}" = 0 ] || printf '%s\0' "${without_avx[@]}" >>"$folder/environment"
  printf '%s\0' "$@" >"$folder/arguments"
  printf '%s' "$PWD" >"$folder/directory"
  cat >"$folder/run" <<'RUN'
#!/bin/bash
# The command's stdout and stderr go over two raw serial lines, through a FIFO each, so that the command sees no terminal.
here=$(dirname "$0")
fifos=$(mktemp -d /run/fifos.XXXXXX)
readers=()
for line in 0 1; do
  stty -F "/dev/ttyS$line" raw -echo
  mkfifo "$fifos/$line"
  cat "$fifos/$line" >"/dev/ttyS$line" &
  readers+=($!)
done
mapfile -d '' -t environment <"$here/environment"
mapfile -d '' -t arguments <"$here/arguments"
(
  cd "$(<"$here/directory")" || exit 125
  exec env -i "${environment[@]}" TMPDIR=/dev/shm "${arguments[@]}"
) </dev/null >"$fifos/0" 2>"$fifos/1"
status=$?
# A background process of the command may still hold a FIFO: wait at most 5 s for remaining output.
for reader in "${readers[@]}"; do timeout 5 tail -s 0.05 -f /dev/null --pid="$reader"; done
echo "$status" >"$here/status"
sync
echo o >/proc/sysrq-trigger
sleep 60
RUN
  chmod +x "$folder/run"
}

uml_boot() {
  local folder=$1 uml ended guest=
  shift
  uml=$(command -v linux.uml) || die "this needs User Mode Linux: apt-get install user-mode-linux"
  [ -r /usr/lib/uml/modules ] || die "the kernel modules of user-mode-linux are not installed"
  trap 'exit 130' INT
  trap 'exit 143' TERM HUP
  # setpriv: the guest ends also if this script is killed.
  setpriv --pdeathsig TERM timeout -k 5 "${GUEST_SECONDS:-0}" "${xstate[@]}" "$uml" umid=guest uml_dir="$folder" mem="${GUEST_MEMORY:-2048M}" \
    root=/dev/root rootfstype=hostfs rootflags=/ rw init="$folder/init" quiet con=null con0=null,fd:1 ssl0=null,fd:3 ssl1=null,fd:4 "$@" "${glibc_without_avx[@]}" \
    3>&1 4>&2 </dev/null >"$folder/console" 2>&1 &
  guest=$!
  # shellcheck disable=SC2064 # expanded now: the number is known
  trap "kill -TERM $guest 2>/dev/null; wait $guest 2>/dev/null; rm -rf '$folder'" EXIT
  wait "$guest"
  ended=$?
  trap "rm -rf '$folder'" EXIT
  [ -s "$folder/status" ] && exit "$(<"$folder/status")"
  tail -n 20 "$folder/console" >&2
  [ "$ended" = 124 ] && {
    echo "${0##*/}: ended after $GUEST_SECONDS s" >&2
    exit 124
  }
  die "the guest ended ($ended) before the command did"
}

# Not below $TMPDIR: the guest's kernel accepts no spaces in its arguments, and only a short path for its control socket.
uml_folder() { mktemp -d /tmp/guest.XXXXXX || die "no temporary folder"; }
