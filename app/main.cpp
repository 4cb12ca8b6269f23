// The program ressort.
#include "app/command_line/command_line.h"
#include "app/program.h"

int main(int argc, char** argv) {
  return ressort::run_program(ressort::command_line::run_command_line, argc, argv);
}
