//! `replica-remote`: the process of a stage whose table has the key `host`. It connects to the agent there, and forwards the steps
//! of the stage ([`stage::remote`]) over an encrypted connection ([`link`]).
//!
//! To the supervisor it is a stage like any other: it has the topics, barriers and states of the stage on the other
//! host, which keeps no state. `docs/explanation/two_machines.md` explains why.
//!
//! Start at [`connect`], which waits for a host and requests the program from the agent. [`stage::remote`] has the
//! requests and answers, [`link`] the encryption.
//!
//! The process must never send a message without encryption, never start a program of another version than its own, and
//! never answer for the other host: while the connection is lost it publishes nothing, and after 30 s the attempt
//! counts as failed, so that the supervisor restarts the run from its last barrier.

use link::{Key, LinkError, StageProgram};
use run::Remote;
use stage::StepError;
use stage::remote::Connection;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Longest wait of a run for a lost network or agent, before the attempt counts as failed: the time to plug in a cable
/// again.
const RECONNECT: Duration = Duration::from_secs(30);
/// Time between two attempts to connect.
const RETRY: Duration = Duration::from_millis(500);

/// The whole program.
pub fn main() -> ExitCode {
    ExitCode::from(stage::remote::run(std::env::args_os().collect(), connect))
}

/// Connects to the program of a table on its host: for a stage of a run, or for a single query.
pub fn connect(remote: &Remote, table: &str, session: Option<&str>) -> Result<Connection, StepError> {
    let key = Key::read(&remote.key).map_err(StepError::configuration)?;
    let wanted = StageProgram {
        version: env!("REPLICA_VERSION").to_owned(),
        table: table.to_owned(),
        program: remote.program.clone(),
        python: remote.python.clone(),
        threads: remote.threads,
        session: session.map(str::to_owned),
    };
    // A query is answered at once or not at all, because a person waits.
    let patience = if session.is_some() { RECONNECT } else { Duration::ZERO };
    let begun = Instant::now();
    let mut is_reported = false;
    loop {
        match connect_once(remote, &key, &wanted) {
            Ok(connection) => return Ok(connection),
            Err(error) if error.is_temporary() && begun.elapsed() < patience => {
                if !std::mem::replace(&mut is_reported, true) {
                    tracing::warn!("{error}; trying again for {} s", patience.as_secs());
                }
                std::thread::sleep(RETRY);
            }
            Err(error) if error.is_temporary() => return Err(StepError::io(error)),
            Err(error) => return Err(StepError::configuration(error)),
        }
    }
}

fn connect_once(remote: &Remote, key: &Key, wanted: &StageProgram) -> Result<Connection, LinkError> {
    let (mut sender, mut receiver) = link::connect(&remote.host, key)?;
    let silence = Duration::try_from_secs_f64(remote.hang_s).unwrap_or(RECONNECT);
    let limited = sender.set_timeout(Some(silence));
    limited.map_err(|source| LinkError::Ended { peer: remote.host.clone(), source })?;
    link::start(&remote.host, wanted, &mut sender, &mut receiver)?;
    Ok(Connection { reader: Box::new(receiver), writer: Box::new(sender) })
}
