//! An authenticated and encrypted stream of bytes over TCP, by the Noise protocol with a shared key.
//!
//! Both ends first send their version in plain text, so that another version is reported as such; the handshake covers them.
//! Then each Noise message follows its length.
//!
//! | bytes | content |
//! |---|---|
//! | 0 .. 12 | `replica link` |
//! | 12 .. 16 | [`VERSION`], u32, little-endian |
//! | next 2 | length of a Noise message, u16, little-endian |
//! | next .. | the message: first the handshake (one by each end; empty if the keys differ), then up to 65519 encrypted bytes and their tag |
//!
//! A message that was changed, repeated, reordered or left out is an error of [`Receiver`].

use crate::{Key, LinkError};
use snow::{Builder, StatelessTransportState};
use std::io::{Error, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Version of the link. Raised with each change of the data on the connection, including `stage::remote`.
pub const VERSION: u32 = 2;

/// The keys of both ends are created for this connection; the shared key authenticates them from the first message on.
const PATTERN: &str = "Noise_NNpsk0_25519_ChaChaPoly_BLAKE2s";
const HELLO_BYTES: usize = 16;
/// Replaces a message of the handshake: an empty one, because the keys differ.
const OTHER_KEY: [u8; 2] = [0; 2];
/// Largest message of the Noise protocol.
const MESSAGE_BYTES: usize = 65535;
/// Bytes of the tag of each message.
const TAG_BYTES: usize = 16;
/// Bytes of a message of the handshake: a public key and a tag. Whoever has no key can send no more.
const HANDSHAKE_BYTES: usize = 32 + TAG_BYTES;
/// Longest duration of a handshake, however often the other end sends a byte.
const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(5);

/// Connects to the agent at `address` (`HOST:PORT`).
pub fn connect(address: &str, key: &Key) -> Result<(Sender, Receiver), LinkError> {
    let unresolved = |source| LinkError::Address { address: address.to_owned(), source };
    let mut last = Error::from(ErrorKind::NotFound);
    for resolved in address.to_socket_addrs().map_err(unresolved)? {
        match TcpStream::connect_timeout(&resolved, HANDSHAKE_TIMEOUT) {
            Ok(stream) => return shake_hands(stream, address, key, End::Run),
            Err(error) => last = error,
        }
    }
    Err(LinkError::Connect { address: address.to_owned(), source: last })
}

/// The other end of [`connect`].
pub fn accept(stream: TcpStream, key: &Key) -> Result<(Sender, Receiver), LinkError> {
    let peer = stream.peer_addr().map_or_else(|_| "unknown".to_owned(), |address| address.to_string());
    shake_hands(stream, &peer, key, End::Agent)
}

/// Which end of a connection this one is.
#[derive(Clone, Copy)]
enum End {
    Run,
    Agent,
}

fn hello() -> [u8; HELLO_BYTES] {
    let mut hello = *b"replica link\0\0\0\0";
    hello[12..].copy_from_slice(&VERSION.to_le_bytes());
    hello
}

fn shake_hands(stream: TcpStream, peer: &str, key: &Key, end: End) -> Result<(Sender, Receiver), LinkError> {
    let ended = |source: Error| LinkError::Ended { peer: peer.to_owned(), source };
    let other_key = |_: snow::Error| LinkError::Key { peer: peer.to_owned() };
    stream.set_nodelay(true).map_err(ended)?;
    let mut timed = DeadlineStream { stream: &stream, deadline: Instant::now() + HANDSHAKE_TIMEOUT };
    check_hello(&mut timed, peer)?;
    let pattern = PATTERN.parse().map_err(other_key)?;
    let covered = hello();
    let build = |builder: Builder<'_>| match end {
        End::Run => builder.build_initiator(),
        End::Agent => builder.build_responder(),
    };
    let builder = Builder::new(pattern).prologue(&covered).and_then(|builder| builder.psk(0, &key.0));
    let mut handshake = builder.and_then(build).map_err(other_key)?;
    let mut buffer = [0; HANDSHAKE_BYTES];
    while !handshake.is_handshake_finished() {
        if handshake.is_my_turn() {
            let len = handshake.write_message(&[], &mut buffer).map_err(other_key)?;
            let framed = [&(len as u16).to_le_bytes()[..], &buffer[..len]].concat();
            timed.write_all(&framed).map_err(ended)?;
        } else {
            let message = read_message(&mut timed, &mut buffer).map_err(ended)?;
            let message = message.ok_or_else(|| ended(ErrorKind::UnexpectedEof.into()))?;
            if let Err(error) = handshake.read_message(message, &mut []) {
                // Whether or not the other end receives it, this end has the error. An end that is only cut off tries
                // again.
                let _ = timed.write_all(&OTHER_KEY);
                return Err(other_key(error));
            }
        }
    }
    let state = Arc::new(handshake.into_stateless_transport_mode().map_err(other_key)?);
    set_timeout(&stream, None).map_err(ended)?;
    let sender = stream.try_clone().map_err(ended)?;
    Ok((Sender::new(sender, Arc::clone(&state)), Receiver::new(stream, state)))
}

/// A connection whose reads and writes all fail after a deadline.
struct DeadlineStream<'a> {
    stream: &'a TcpStream,
    deadline: Instant,
}

impl DeadlineStream<'_> {
    /// Limits the next call to the time that is left.
    fn limit(&self) -> std::io::Result<()> {
        let left = self.deadline.saturating_duration_since(Instant::now());
        if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { set_timeout(self.stream, Some(left)) }
    }
}

impl Read for DeadlineStream<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.limit()?;
        self.stream.read(buffer)
    }
}

impl Write for DeadlineStream<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.limit()?;
        self.stream.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.stream.flush()
    }
}

fn check_hello(stream: &mut DeadlineStream<'_>, peer: &str) -> Result<(), LinkError> {
    let mut theirs = [0; HELLO_BYTES];
    let exchanged = stream.write_all(&hello()).and_then(|()| stream.read_exact(&mut theirs));
    exchanged.map_err(|source| LinkError::Ended { peer: peer.to_owned(), source })?;
    if theirs[..12] != hello()[..12] {
        return Err(LinkError::Foreign { peer: peer.to_owned() });
    }
    let got = u32::from_le_bytes([theirs[12], theirs[13], theirs[14], theirs[15]]);
    if got != VERSION {
        return Err(LinkError::Version { peer: peer.to_owned(), got, expected: VERSION });
    }
    Ok(())
}

fn set_timeout(stream: &TcpStream, timeout: Option<Duration>) -> std::io::Result<()> {
    stream.set_read_timeout(timeout)?;
    stream.set_write_timeout(timeout)
}

/// The next message on the wire, which must fit into `buffer`; `None` if the other end has closed the connection before
/// it.
fn read_message<'a>(stream: &mut impl Read, buffer: &'a mut [u8]) -> std::io::Result<Option<&'a [u8]>> {
    let mut len = [0; 2];
    let n = loop {
        match stream.read(&mut len) {
            Ok(0) => return Ok(None),
            Ok(n) => break n,
            // Interrupted by a signal; with a timeout, the kernel does not repeat the call.
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    };
    stream.read_exact(&mut len[n..])?;
    let len = usize::from(u16::from_le_bytes(len));
    let limit = buffer.len();
    let too_long =
        || Error::new(ErrorKind::InvalidData, format!("a message of {len} bytes; up to {limit} are allowed"));
    let message = buffer.get_mut(..len).ok_or_else(too_long)?;
    stream.read_exact(message)?;
    Ok(Some(message))
}

/// The writing half of a connection. Collects bytes until a message is full, or until `flush`.
pub struct Sender {
    stream: TcpStream,
    state: Arc<StatelessTransportState>,
    nonce: u64,
    pending: Vec<u8>,
    /// Length and encrypted message.
    framed: Vec<u8>,
}

impl Sender {
    fn new(stream: TcpStream, state: Arc<StatelessTransportState>) -> Self {
        let pending = Vec::with_capacity(MESSAGE_BYTES - TAG_BYTES);
        Self { stream, state, nonce: 0, pending, framed: vec![0; 2 + MESSAGE_BYTES] }
    }

    /// Makes reads and writes of both halves fail after this time without progress.
    pub fn set_timeout(&self, timeout: Option<Duration>) -> std::io::Result<()> {
        set_timeout(&self.stream, timeout)
    }

    /// The connection itself, for its options and its end.
    pub fn stream(&self) -> &TcpStream {
        &self.stream
    }

    fn send_pending(&mut self) -> std::io::Result<()> {
        let len = self.state.write_message(self.nonce, &self.pending, &mut self.framed[2..]).map_err(Error::other)?;
        self.framed[..2].copy_from_slice(&(len as u16).to_le_bytes());
        self.nonce += 1;
        self.pending.clear();
        self.stream.write_all(&self.framed[..2 + len])
    }
}

impl Write for Sender {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let room = MESSAGE_BYTES - TAG_BYTES - self.pending.len();
        let n = bytes.len().min(room);
        self.pending.extend_from_slice(&bytes[..n]);
        if n == room {
            self.send_pending()?;
        }
        Ok(n)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        if self.pending.is_empty() { Ok(()) } else { self.send_pending() }
    }
}

/// The reading half of a connection.
pub struct Receiver {
    stream: TcpStream,
    state: Arc<StatelessTransportState>,
    nonce: u64,
    encrypted: Vec<u8>,
    message: Vec<u8>,
    /// The part of `message` that has not been read.
    unread: std::ops::Range<usize>,
}

impl Receiver {
    fn new(stream: TcpStream, state: Arc<StatelessTransportState>) -> Self {
        let encrypted = vec![0; MESSAGE_BYTES];
        let message = vec![0; MESSAGE_BYTES];
        Self { stream, state, nonce: 0, encrypted, message, unread: 0..0 }
    }

    /// The bytes of the next message, or the rest of the last one; empty at the end of the connection.
    pub fn next_bytes(&mut self) -> std::io::Result<&[u8]> {
        self.fill()?;
        let unread = std::mem::take(&mut self.unread);
        Ok(&self.message[unread])
    }

    /// Waits for a message if the last one has been read.
    fn fill(&mut self) -> std::io::Result<()> {
        while self.unread.is_empty() {
            let Some(encrypted) = read_message(&mut self.stream, &mut self.encrypted)? else { return Ok(()) };
            let len = self.state.read_message(self.nonce, encrypted, &mut self.message);
            let changed = |_| Error::new(ErrorKind::InvalidData, "a message was changed in transit");
            self.unread = 0..len.map_err(changed)?;
            self.nonce += 1;
        }
        Ok(())
    }
}

impl Read for Receiver {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.fill()?;
        let n = self.unread.len().min(buffer.len());
        buffer[..n].copy_from_slice(&self.message[self.unread.start..][..n]);
        self.unread.start += n;
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    type Ends = (Sender, Receiver);

    fn key(byte: u8) -> Key {
        Key([byte; 32])
    }

    fn listener() -> (TcpListener, String) {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address").to_string();
        (listener, address)
    }

    /// Both ends of a connection between holders of these keys.
    fn ends(ours: u8, theirs: u8) -> (Result<Ends, LinkError>, Result<Ends, LinkError>) {
        let (listener, address) = listener();
        std::thread::scope(|scope| {
            let accepted = scope.spawn(|| accept(listener.accept().expect("a connection").0, &key(theirs)));
            (connect(&address, &key(ours)), accepted.join().expect("no panic"))
        })
    }

    #[test]
    fn bytes_arrive_in_both_directions_and_the_end_is_seen() {
        let (ours, theirs) = ends(1, 1);
        let (mut sender, mut receiver) = ours.expect("ours");
        let (mut their_sender, mut their_receiver) = theirs.expect("theirs");
        let bytes: Vec<u8> = (0..1_000_000_u32).map(|k| (k % 251) as u8).collect();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                sender.write_all(&bytes).and_then(|()| sender.flush()).expect("sent");
                drop((sender, receiver.read(&mut [0; 3]).map(|n| assert_eq!(n, 3))));
            });
            let mut received = vec![0; bytes.len()];
            their_receiver.read_exact(&mut received).expect("received");
            assert!(received == bytes);
            their_sender.write_all(b"end").and_then(|()| their_sender.flush()).expect("sent");
        });
        drop(receiver);
        assert_eq!(their_receiver.next_bytes().expect("the end"), b"");
    }

    #[test]
    fn end_with_another_key_is_refused_by_both() {
        let (ours, theirs) = ends(1, 2);
        assert!(matches!(theirs, Err(LinkError::Key { .. })), "{:?}", theirs.err());
        assert!(matches!(ours, Err(LinkError::Key { .. })), "{:?}", ours.err());
    }

    /// A run tries again after a cut, and gives up if the keys differ.
    #[test]
    fn connection_cut_during_the_handshake_is_no_refusal() {
        let (listener, address) = listener();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let (mut stream, _) = listener.accept().expect("a connection");
                stream.write_all(&hello()).expect("sent");
                // All bytes that the other end sends before it waits.
                stream.read_exact(&mut [0; 66]).expect("received");
            });
            let error = connect(&address, &key(1)).err().expect("cut");
            assert!(error.is_temporary(), "{error}");
        });
    }

    /// Sends the bytes of a program without the protocol, and returns the other end's error.
    fn refused(bytes: &[u8]) -> LinkError {
        let (listener, address) = listener();
        std::thread::scope(|scope| {
            let accepted = scope.spawn(|| accept(listener.accept().expect("a connection").0, &key(1)));
            let mut stream = TcpStream::connect(address).expect("connects");
            stream.write_all(bytes).expect("sent");
            accepted.join().expect("no panic").err().expect("refused")
        })
    }

    #[test]
    fn other_version_and_foreign_program_are_named() {
        let mut newer = hello();
        newer[12] += 1;
        let error = refused(&newer).to_string();
        let expected = format!("has version {} of the link, this program has {VERSION}", VERSION + 1);
        assert!(error.contains(&expected), "{error}");
        assert!(matches!(refused(b"GET / HTTP/1.1\r\n\r\n"), LinkError::Foreign { .. }));
    }

    #[test]
    fn message_of_the_handshake_is_as_long_as_a_key_and_a_tag() {
        let long = [&hello()[..], &49_u16.to_le_bytes(), &[0; 49]].concat();
        let error = refused(&long);
        let LinkError::Ended { source, .. } = &error else { panic!("{error}") };
        assert_eq!(source.to_string(), "a message of 49 bytes; up to 48 are allowed");
    }

    #[test]
    fn handshake_ends_at_its_deadline_however_often_a_byte_arrives() {
        let (listener, address) = listener();
        let mut slow = TcpStream::connect(address).expect("connects");
        let stream = listener.accept().expect("a connection").0;
        let mut timed = DeadlineStream { stream: &stream, deadline: Instant::now() + Duration::from_millis(200) };
        std::thread::scope(|scope| {
            // More bytes than arrive before the deadline; the connection is closed after it.
            scope.spawn(move || {
                while slow.write_all(&[0]).is_ok() {
                    std::thread::park_timeout(Duration::from_millis(20));
                }
            });
            let error = timed.read_exact(&mut vec![0; 1 << 16]).expect_err("the deadline");
            assert!(matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock), "{error}");
            stream.shutdown(std::net::Shutdown::Both).expect("closed");
        });
    }

    /// A message with one bit changed in transit is not delivered.
    #[test]
    fn changed_message_is_an_error() {
        let (listener, address) = listener();
        let (outer, outer_address) = self::listener();
        std::thread::scope(|scope| {
            let accepted = scope.spawn(|| accept(listener.accept().expect("a connection").0, &key(1)));
            scope.spawn(|| {
                let client = outer.accept().expect("a connection").0;
                let server = TcpStream::connect(address).expect("connects");
                let mut from_server = server.try_clone().expect("a copy");
                let mut to_client = client.try_clone().expect("a copy");
                scope.spawn(move || std::io::copy(&mut from_server, &mut to_client));
                let mut client = client;
                let mut server = server;
                let mut n = 0_usize;
                let mut byte = [0];
                while client.read(&mut byte).is_ok_and(|read| read == 1) {
                    n += 1;
                    // The handshake has 16 + 2 + 48 bytes of the client.
                    byte[0] ^= u8::from(n == 100);
                    if server.write_all(&byte).is_err() {
                        break;
                    }
                }
            });
            let (mut sender, receiver) = connect(&outer_address, &key(1)).expect("connected");
            let (their_sender, mut their_receiver) = accepted.join().expect("no panic").expect("accepted");
            sender.write_all(&[7; 1000]).and_then(|()| sender.flush()).expect("sent");
            let error = their_receiver.next_bytes().expect_err("refused");
            assert_eq!(error.kind(), ErrorKind::InvalidData);
            drop((sender, receiver, their_receiver, their_sender));
        });
    }
}
