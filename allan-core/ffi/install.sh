#!/bin/sh
# Copies the static library, the header and the files for CMake and pkg-config: install.sh LIBRARY PREFIX
set -eu
here=$(dirname "$0")
mkdir -p "$2/include" "$2/lib/cmake/allan_core" "$2/lib/pkgconfig"
prefix=$(cd "$2" && pwd)
cp "$1" "$prefix/lib/liballan_core.a"
cp "$here/include/allan_core.h" "$prefix/include/"
cp "$here"/cmake/allan_coreConfig*.cmake "$prefix/lib/cmake/allan_core/"
sed "s|@PREFIX@|$prefix|" "$here/cmake/allan_core.pc.in" > "$prefix/lib/pkgconfig/allan_core.pc"
