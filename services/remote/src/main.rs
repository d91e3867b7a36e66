//! The process that stands for a stage on another host.
fn main() -> std::process::ExitCode {
    remote::main()
}
