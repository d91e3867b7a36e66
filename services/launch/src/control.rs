//! Requests from other terminals, such as `replica swap` and `replica stop`, and the answers to them. See [`run::control`].

use ipc::Domain;
use run::Outcome;
use run::control::{Answer, MAX_REQUEST, Request, socket_of};
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Largest number of simultaneous clients: people at terminals.
const MAX_CLIENTS: usize = 8;
/// Longest time from the connection to the complete request.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);
/// Interval of the answers to a waiting client, which gives up after ten seconds without one.
const ANSWER_EVERY: Duration = Duration::from_secs(1);

/// Identifies a client.
pub type ClientId = u64;

/// An error that prevents the supervisor from listening.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// The socket cannot be created.
    #[error("{socket}: {source}")]
    Socket {
        /// The socket.
        socket: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// Other users could connect.
    #[error("{folder}: {source}")]
    Folder {
        /// The folder of the socket.
        folder: PathBuf,
        /// Reason why it cannot be used.
        source: ipc::PrivateFolderError,
    },
}

/// Listens until it is dropped.
pub struct Control {
    listener: UnixListener,
    folder: PathBuf,
    clients: BTreeMap<ClientId, Client>,
    next_id: ClientId,
}

struct Client {
    stream: UnixStream,
    connected: Instant,
    /// The received part of the request. `None`: the request was returned by [`Control::requests`].
    request: Option<Vec<u8>>,
    /// The last intermediate answer.
    working: String,
    answered: Instant,
}

/// A request of a client.
pub struct ClientRequest {
    /// The client.
    pub client: ClientId,
    /// Its request.
    pub request: Request,
}

impl Control {
    /// Listens for the run of `domain`. The socket of a killed supervisor of the same run is replaced.
    pub fn open(domain: &Domain) -> Result<Self, ControlError> {
        let socket = socket_of(domain.name());
        let folder = socket.parent().unwrap_or(Path::new("/tmp")).to_owned();
        let failed = |source: std::io::Error| ControlError::Socket { socket: socket.clone(), source };
        if !ipc::is_foreign(&folder) {
            ignore_absent(std::fs::remove_dir_all(&folder)).map_err(failed)?;
        }
        ipc::create_private_folder(&folder)
            .map_err(|source| ControlError::Folder { folder: folder.clone(), source })?;
        let listener = UnixListener::bind(&socket).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        Ok(Self { listener, folder, clients: BTreeMap::new(), next_id: 0 })
    }

    /// The requests since the last call. Never waits.
    pub fn requests(&mut self) -> Vec<ClientRequest> {
        while let Ok((stream, _)) = self.listener.accept() {
            if self.clients.len() < MAX_CLIENTS && stream.set_nonblocking(true).is_ok() {
                self.clients.insert(self.next_id, Client::new(stream));
                self.next_id += 1;
            }
        }
        let mut requests = Vec::new();
        self.clients.retain(|id, client| match client.read_request() {
            Received::Request(request) => {
                requests.push(ClientRequest { client: *id, request });
                true
            }
            Received::Incomplete => client.answer_if_due(),
            Received::Disconnected => false,
        });
        requests
    }

    /// Reports the current step to the client, now and every second.
    pub fn working(&mut self, id: ClientId, text: &str) {
        if let Some(client) = self.clients.get_mut(&id) {
            text.clone_into(&mut client.working);
            if !client.send(&Answer::Working(text.to_owned())) {
                self.clients.remove(&id);
            }
        }
    }

    /// Sends the final answer, if the client is still connected.
    pub fn answer(&mut self, id: ClientId, answer: &Answer) {
        if let Some(mut client) = self.clients.remove(&id) {
            client.send(answer);
        }
    }

    /// Reports to all waiting clients that the run has ended, and removes the socket.
    pub fn end(&mut self, outcome: Outcome) {
        for (_, mut client) in std::mem::take(&mut self.clients) {
            client.send(&Answer::Ended(outcome));
        }
        self.remove_folder();
    }

    fn remove_folder(&self) {
        // The next run replaces a folder that cannot be removed.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        self.remove_folder();
    }
}

enum Received {
    Request(Request),
    Incomplete,
    Disconnected,
}

impl Client {
    fn new(stream: UnixStream) -> Self {
        let now = Instant::now();
        Self { stream, connected: now, request: Some(Vec::new()), working: String::new(), answered: now }
    }

    fn read_request(&mut self) -> Received {
        let Some(text) = &mut self.request else { return Received::Incomplete };
        let mut bytes = [0; 4096];
        // A client that has sent its request may close its sending half and wait for the answer.
        let mut has_ended = false;
        loop {
            match self.stream.read(&mut bytes) {
                Ok(0) => {
                    has_ended = true;
                    break;
                }
                Ok(n) => text.extend_from_slice(&bytes[..n]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(_) => return Received::Disconnected,
            }
            if text.len() > MAX_REQUEST {
                return Received::Disconnected;
            }
        }
        let end = match text.iter().position(|byte| *byte == b'\n') {
            Some(end) => end,
            None if has_ended && !text.is_empty() => text.len(),
            None if has_ended || self.connected.elapsed() >= REQUEST_TIMEOUT => return Received::Disconnected,
            None => return Received::Incomplete,
        };
        match serde_json::from_slice(&text[..end]) {
            Ok(request) => {
                self.request = None;
                Received::Request(request)
            }
            Err(error) => {
                self.send(&Answer::Refused(vec![format!("unknown request: {error}")]));
                Received::Disconnected
            }
        }
    }

    /// Answers if an answer is due. `false` if the client has disconnected.
    fn answer_if_due(&mut self) -> bool {
        self.request.is_some()
            || self.answered.elapsed() < ANSWER_EVERY
            || self.send(&Answer::Working(self.working.clone()))
    }

    /// Sends one line. It fits into the socket's buffer unless the client has stopped reading.
    fn send(&mut self, answer: &Answer) -> bool {
        self.answered = Instant::now();
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Shutdown;

    /// A client that has closed its sending half.
    struct HalfClosed {
        client: Client,
        /// Its own end.
        own: UnixStream,
    }

    fn half_closed(text: &str) -> HalfClosed {
        let (mut own, other) = UnixStream::pair().expect("a pair");
        other.set_nonblocking(true).expect("a socket");
        own.write_all(text.as_bytes()).expect("sends");
        own.shutdown(Shutdown::Write).expect("closes");
        HalfClosed { client: Client::new(other), own }
    }

    #[test]
    fn request_followed_by_a_half_close_is_answered() {
        // Without a newline the end of the stream ends the request.
        for text in ["{\"stop\":{\"now\":true}}\n", "{\"stop\":{\"now\":true}}"] {
            let HalfClosed { mut client, mut own } = half_closed(text);
            let Received::Request(request) = client.read_request() else { panic!("{text:?} is a request") };
            assert_eq!(request, Request::Stop { now: true });
            assert!(matches!(client.read_request(), Received::Incomplete), "one request, however often it is read");
            assert!(client.send(&Answer::Ended(Outcome::Stopped)));
            drop(client);
            let mut answer = String::new();
            own.read_to_string(&mut answer).expect("an answer");
            assert_eq!(answer, "{\"ended\":\"stopped\"}\n");
        }
    }

    #[test]
    fn cut_request_is_refused_and_an_empty_one_is_dropped() {
        let HalfClosed { mut client, mut own } = half_closed("{\"stop\":{\"no");
        assert!(matches!(client.read_request(), Received::Disconnected));
        drop(client);
        let mut answer = String::new();
        own.read_to_string(&mut answer).expect("an answer");
        assert!(answer.contains("unknown request"), "{answer}");
        let HalfClosed { mut client, own: _own } = half_closed("");
        assert!(matches!(client.read_request(), Received::Disconnected));
    }
}
