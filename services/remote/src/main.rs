//! The proxy process of a stage on another host.
fn main() -> std::process::ExitCode {
    remote::main()
}
