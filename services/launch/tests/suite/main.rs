//! `replica-launch` as a program. The tests of running stages are in the workspace's tests/.

mod command_line;
