//! `replica-launch` as a program. What it does with stages is tested in the workspace's tests/.

mod command_line;
