# Compiles for 64-bit ARM (Raspberry Pi) on Debian for x86-64, with g++-aarch64-linux-gnu, qemu-user
# and the arm64 libraries, such as libjack-jackd2-dev:arm64 after dpkg --add-architecture arm64.
#
#   cmake -B build-arm64 -DCMAKE_TOOLCHAIN_FILE=app/packaging/arm64.cmake -DRESSORT_TESTS=OFF
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE arm64)
set(ENV{PKG_CONFIG_LIBDIR} /usr/lib/aarch64-linux-gnu/pkgconfig:/usr/share/pkgconfig)
find_program(CMAKE_CROSSCOMPILING_EMULATOR NAMES qemu-aarch64-static qemu-aarch64)
