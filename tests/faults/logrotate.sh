#!/usr/bin/env bash
# Promise: the logrotate file is understood, rotates a path that is due, and leaves the new name to the program.
set -euo pipefail
export PATH=$PATH:/usr/sbin:/sbin
command -v logrotate >/dev/null || { echo "logrotate is not installed: toolchains/install test"; exit 77; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder"
sed "s#/var/lib/stillmesh/#$folder/#; s#su root root#su $(id -un) $(id -gn)#" "$1" >"$folder/rules"
chmod 644 "$folder/rules"
echo "1 0 0 0 0 0 0 1" >"$folder/trajectory.txt"
logrotate -d "$folder/rules" >"$folder/said" 2>&1 || { cat "$folder/said"; exit 1; }
! grep -iE "^error|unknown|bad|skipping" "$folder/said"
grep -q "considering log $folder/trajectory.txt" "$folder/said"
sed -i "s#^        ! systemctl.*#        touch $folder/reloaded#" "$folder/rules"
logrotate --force --state "$folder/state" "$folder/rules"
[[ -e $folder/reloaded && -s $folder/trajectory.txt.1 && ! -e $folder/trajectory.txt ]] ||
    { ls "$folder"; echo "not rotated, or the service was not told"; exit 1; }
