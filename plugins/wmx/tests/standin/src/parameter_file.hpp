// Parameters of the engine: their file and their ranges.
#pragma once

#include <memory>

#include "client.hpp"

namespace standin {

// Both objects together are about 0.1 MB: kept off the stack.
struct Parameters {
    Config::SystemParam system;
    Config::AxisParam axis;
};

// Reads a file into the objects that are given; what it lacks stays, or becomes 0.
int import_file(const char *path, Config::SystemParam *system, Config::AxisParam *axes, bool zero);
int write_file(const char *path, Config::SystemParam &system, Config::AxisParam &axes);

// Counts members out of their range, and marks them in the error objects that are given.
int bad_members(Parameters &given, Config::SystemParam *system, Config::AxisParam *axes);

// Those in force, and putting new ones into force, all or none.
std::unique_ptr<Parameters> current(WMX3Api *api, int &code);
int set_all(WMX3Api *api, Parameters &given, Config::SystemParam *system_error,
            Config::AxisParam *axis_error);

}  // namespace standin
