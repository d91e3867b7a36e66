//! Describes itself as the relay, but is not.
fn main() -> std::process::ExitCode {
    match std::env::args().nth(1).as_deref() {
        Some("run") => stage::run::<misbehaving::Liar>(),
        _ => stage::run::<misbehaving::Relay>(),
    }
}
