//! The supervisor's ear: requests from other terminals, and the answers to them. See [`stage::control`].

use ipc::Domain;
use stage::control::{Answer, MAX_REQUEST, Request, socket_of};
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Those who ask at a time: people at terminals.
const MAX_ASKERS: usize = 8;
/// Who connects has this long to say what for.
const REQUEST_PATIENCE: Duration = Duration::from_secs(5);
/// How often those who wait hear that they are not forgotten; they give up after ten seconds.
const SPEAK_EVERY: Duration = Duration::from_secs(1);

/// Names one who asked.
pub type AskerId = u64;

/// Listens as long as it lives.
pub struct Control {
    listener: UnixListener,
    folder: PathBuf,
    askers: BTreeMap<AskerId, Asker>,
    next_id: AskerId,
}

struct Asker {
    stream: UnixStream,
    connected: Instant,
    /// What has been read of the request. `None`: it has been handed over.
    request: Option<Vec<u8>>,
    /// What is being done for them.
    doing: String,
    spoken: Instant,
}

impl Control {
    /// Listens for the run of `domain`. What a dead supervisor of the same run left is replaced.
    pub fn open(domain: &Domain) -> Result<Self, String> {
        let socket = socket_of(domain.name());
        let folder = socket.parent().unwrap_or(Path::new("/tmp")).to_owned();
        let failed = |error: std::io::Error| format!("{}: {error}", socket.display());
        ignore_absent(std::fs::remove_dir_all(&folder)).map_err(failed)?;
        // Another user's folder of this name cannot be removed, and this one's is nobody else's.
        std::fs::DirBuilder::new().mode(0o700).create(&folder).map_err(failed)?;
        if std::fs::metadata(&folder).map_err(failed)?.mode() & 0o077 != 0 {
            return Err(format!("{} is open to other users", folder.display()));
        }
        let listener = UnixListener::bind(&socket).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        Ok(Self { listener, folder, askers: BTreeMap::new(), next_id: 0 })
    }

    /// What has been asked for since the last call. Never waits.
    pub fn requests(&mut self) -> Vec<(AskerId, Request)> {
        while let Ok((stream, _)) = self.listener.accept() {
            if self.askers.len() < MAX_ASKERS && stream.set_nonblocking(true).is_ok() {
                let now = Instant::now();
                let request = Some(Vec::new());
                let asker = Asker { stream, connected: now, request, doing: String::new(), spoken: now };
                self.askers.insert(self.next_id, asker);
                self.next_id += 1;
            }
        }
        let mut requests = Vec::new();
        self.askers.retain(|id, asker| match asker.read_request() {
            Reading::Request(request) => {
                requests.push((*id, request));
                true
            }
            Reading::Wait => asker.speak_if_due(),
            Reading::Gone => false,
        });
        requests
    }

    /// Says what is being done for the one who asked, now and every second.
    pub fn working(&mut self, id: AskerId, text: &str) {
        if let Some(asker) = self.askers.get_mut(&id) {
            text.clone_into(&mut asker.doing);
            if !asker.say(&Answer::Working(text.to_owned())) {
                self.askers.remove(&id);
            }
        }
    }

    /// The last word. Who has left does not hear it.
    pub fn answer(&mut self, id: AskerId, answer: &Answer) {
        if let Some(mut asker) = self.askers.remove(&id) {
            asker.say(answer);
        }
    }

    /// The last word to all who still wait.
    pub fn end(&mut self, outcome: &str) {
        for (_, mut asker) in std::mem::take(&mut self.askers) {
            asker.say(&Answer::Ended(outcome.to_owned()));
        }
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        // What cannot be removed is replaced by the next run.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

enum Reading {
    Request(Request),
    Wait,
    Gone,
}

impl Asker {
    fn read_request(&mut self) -> Reading {
        let Some(text) = &mut self.request else { return Reading::Wait };
        let mut bytes = [0; 4096];
        loop {
            match self.stream.read(&mut bytes) {
                Ok(0) => return Reading::Gone,
                Ok(n) => text.extend_from_slice(&bytes[..n]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(_) => return Reading::Gone,
            }
            if text.len() > MAX_REQUEST {
                return Reading::Gone;
            }
        }
        let Some(end) = text.iter().position(|byte| *byte == b'\n') else {
            return if self.connected.elapsed() < REQUEST_PATIENCE { Reading::Wait } else { Reading::Gone };
        };
        match serde_json::from_slice(&text[..end]) {
            Ok(request) => {
                self.request = None;
                Reading::Request(request)
            }
            Err(error) => {
                self.say(&Answer::Refused(vec![format!("a request that this supervisor does not know: {error}")]));
                Reading::Gone
            }
        }
    }

    /// `false` if nobody is there any more.
    fn speak_if_due(&mut self) -> bool {
        self.request.is_some() || self.spoken.elapsed() < SPEAK_EVERY || self.say(&Answer::Working(self.doing.clone()))
    }

    /// One line; it is small enough for the socket's buffer, or the reader is stuck.
    fn say(&mut self, answer: &Answer) -> bool {
        self.spoken = Instant::now();
        let mut text = serde_json::to_vec(answer).unwrap_or_default();
        text.push(b'\n');
        self.stream.write_all(&text).is_ok()
    }
}

fn ignore_absent(result: std::io::Result<()>) -> std::io::Result<()> {
    match result {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
