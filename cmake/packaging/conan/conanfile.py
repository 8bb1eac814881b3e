"""Conan 2 recipe. From the root of the repository: conan create cmake/packaging/conan"""
import os
import re

from conan import ConanFile
from conan.tools.files import copy, load

REPOSITORY = os.path.normpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../.."))


class Esokit(ConanFile):
    name = "esokit"
    license = "MIT"
    description = "Extended state observers and disturbance-rejection controllers, header-only C++20"
    topics = ("control", "observer", "adrc", "header-only")
    package_type = "header-library"
    settings = "os", "arch", "compiler", "build_type"
    no_copy_source = True

    def set_version(self):
        text = load(self, os.path.join(REPOSITORY, "CMakeLists.txt"))
        self.version = re.search(r"project\(esokit VERSION ([0-9.]+)", text).group(1)

    def export_sources(self):
        for pattern in ("CMakeLists.txt", "LICENSE", "include/*", "cmake/*"):
            copy(self, pattern, src=REPOSITORY, dst=self.export_sources_folder)

    def requirements(self):
        self.requires("eigen/[>=3.3 <4]", transitive_headers=True)

    def package_id(self):
        self.info.clear()

    def package(self):
        copy(self, "LICENSE", src=self.source_folder, dst=os.path.join(self.package_folder, "licenses"))
        copy(self, "*", src=os.path.join(self.source_folder, "include"),
             dst=os.path.join(self.package_folder, "include"))

    def package_info(self):
        self.cpp_info.bindirs = []
        self.cpp_info.libdirs = []
        self.cpp_info.set_property("cmake_file_name", "esokit")
        self.cpp_info.set_property("cmake_target_name", "esokit::esokit")
        self.cpp_info.set_property("pkg_config_name", "esokit")
