//! The way of other dataflows, for comparison: each message is written into a Unix stream socket to each consumer and read
//! into memory of the consumer's own.
//!
//! On the socket, the consumer says first who it is and what it expects ([`HELLO_BYTES`]); then come messages:
//!
//! | bytes | content |
//! |---|---|
//! | 0 .. 64 | [`Envelope`] |
//! | 64 .. | `T::Header` |
//! | next .. | the rows, without gaps |
//!
//! A thread of the consumer reads them, at most a queue's length ahead of the stage, so that a producer never waits for
//! a consumer that waits for another of its topics. Credits, acknowledgements and wakes are those of the shared way.

use crate::{Channel, IpcError, Node, Waker};
use messages::pod::{bytes_from_rows, bytes_from_rows_mut, zeroed_rows};
use messages::{Envelope, Message, Pod};
use std::cell::RefCell;
use std::io::{ErrorKind, IoSlice, Read, Write};
use std::net::Shutdown;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::thread::JoinHandle;

/// Index among the consumers u32, version u32, layout u64, little-endian.
const HELLO_BYTES: usize = 16;

fn hello(channel: &Channel, index: u32) -> [u8; HELLO_BYTES] {
    let mut bytes = [0; HELLO_BYTES];
    bytes[..4].copy_from_slice(&index.to_le_bytes());
    bytes[4..8].copy_from_slice(&channel.version.to_le_bytes());
    bytes[8..].copy_from_slice(&channel.layout.to_le_bytes());
    bytes
}

fn socket_path(node: &Node, channel: &Channel) -> PathBuf {
    node.1.root().join(format!("{}.socket", channel.name))
}

fn io(what: &str, channel: &Channel) -> impl Fn(std::io::Error) -> IpcError {
    let what = format!("{what} the socket of {}", channel.name);
    move |cause| IpcError::Io { what: what.clone(), cause }
}

/// A message under construction, in memory of this process.
pub(crate) struct OwnLoan<T: Message> {
    header: Box<T::Header>,
    rows: Vec<T::Row>,
    len: usize,
}

impl<T: Message> OwnLoan<T> {
    pub(crate) fn new(capacity: usize) -> Self {
        Self { header: Box::default(), rows: zeroed_rows(capacity), len: 0 }
    }
    pub(crate) fn capacity(&self) -> usize {
        self.rows.len()
    }
    pub(crate) fn rows(&self) -> &[T::Row] {
        &self.rows[..self.len]
    }
    pub(crate) fn header_mut(&mut self) -> &mut T::Header {
        &mut self.header
    }
    pub(crate) fn reserve(&mut self, n: usize) -> Option<&mut [T::Row]> {
        let start = self.len;
        let rows = self.rows[start..].get_mut(..n)?;
        self.len += n;
        Some(rows)
    }
}

/// A message in memory of this process.
pub(crate) struct OwnMessage<T: Message> {
    pub(crate) envelope: Envelope,
    pub(crate) header: Box<T::Header>,
    pub(crate) rows: Vec<T::Row>,
}

/// The producing end.
pub(crate) struct Outlet {
    channel: Channel,
    path: PathBuf,
    listener: UnixListener,
    consumers: RefCell<Vec<Option<UnixStream>>>,
}

impl Outlet {
    pub(crate) fn open<T: Message>(node: &Node, channel: &Channel) -> Result<Self, IpcError> {
        if (channel.version, channel.layout) != (T::VERSION, T::LAYOUT) {
            let topic = format!("opening topic {}", channel.name);
            return Err(IpcError::transport(topic, "another version or layout"));
        }
        let path = socket_path(node, channel);
        let listener = UnixListener::bind(&path).map_err(io("binding", channel))?;
        listener.set_nonblocking(true).map_err(io("opening", channel))?;
        let consumers = RefCell::new(channel.consumers.iter().map(|_| None).collect());
        Ok(Self { channel: channel.clone(), path, listener, consumers })
    }

    /// Lets in who waits at the door; whether all are there.
    pub(crate) fn connect(&self) -> Result<bool, IpcError> {
        loop {
            match self.listener.accept() {
                Ok((stream, _)) => self.admit(stream)?,
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) => return Err(io("accepting on", &self.channel)(error)),
            }
        }
        Ok(self.consumers.borrow().iter().all(Option::is_some))
    }

    fn admit(&self, mut stream: UnixStream) -> Result<(), IpcError> {
        let mut said = [0; HELLO_BYTES];
        stream.set_nonblocking(false).map_err(io("opening", &self.channel))?;
        stream.read_exact(&mut said).map_err(io("reading", &self.channel))?;
        let index = u32::from_le_bytes([said[0], said[1], said[2], said[3]]);
        let mut consumers = self.consumers.borrow_mut();
        match consumers.get_mut(index as usize) {
            Some(place) if said == hello(&self.channel, index) => {
                *place = Some(stream);
                Ok(())
            }
            _ => {
                let what = format!("consumer {index} of {}", self.channel.name);
                Err(IpcError::transport(what, "is none of its consumers or expects another version or layout"))
            }
        }
    }

    /// Writes the message to every consumer; the number that it reached.
    pub(crate) fn send<T: Message>(&self, loan: &OwnLoan<T>, mut envelope: Envelope) -> usize {
        envelope.len = loan.len as u32;
        let envelope = [envelope];
        let parts = [
            bytes_from_rows(&envelope),
            bytes_from_rows(std::slice::from_ref(&*loan.header)),
            bytes_from_rows(loan.rows()),
        ];
        let mut consumers = self.consumers.borrow_mut();
        consumers.iter_mut().flatten().filter_map(|stream| write_all(stream, parts).ok()).count()
    }
}

impl Drop for Outlet {
    fn drop(&mut self) {
        // The supervisor wipes the folder in any case.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// All parts, in as few calls as the socket allows.
fn write_all(stream: &mut UnixStream, parts: [&[u8]; 3]) -> std::io::Result<()> {
    let mut slices = parts.map(IoSlice::new);
    let mut left = &mut slices[..];
    IoSlice::advance_slices(&mut left, 0);
    while !left.is_empty() {
        match stream.write_vectored(left) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(n) => IoSlice::advance_slices(&mut left, n),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// The consuming end.
pub(crate) struct Inlet<T: Message> {
    channel: Channel,
    path: PathBuf,
    index: usize,
    domain: crate::Domain,
    connection: RefCell<Option<Connection<T>>>,
}

struct Connection<T: Message> {
    stream: UnixStream,
    arrived: Receiver<Result<OwnMessage<T>, IpcError>>,
    reader: Option<JoinHandle<()>>,
}

impl<T: Message> Inlet<T> {
    pub(crate) fn new(node: &Node, channel: &Channel, index: usize) -> Self {
        let path = socket_path(node, channel);
        Self { channel: channel.clone(), path, index, domain: node.1.clone(), connection: RefCell::new(None) }
    }

    /// Goes to the producer's door, if it is there.
    pub(crate) fn connect(&self) -> Result<bool, IpcError> {
        let mut connection = self.connection.borrow_mut();
        if connection.is_some() {
            return Ok(true);
        }
        let mut stream = match UnixStream::connect(&self.path) {
            Ok(stream) => stream,
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::ConnectionRefused) => {
                return Ok(false);
            }
            Err(error) => return Err(io("connecting to", &self.channel)(error)),
        };
        stream.write_all(&hello(&self.channel, self.index as u32)).map_err(io("writing to", &self.channel))?;
        let (sender, arrived) = sync_channel(self.channel.queue);
        let mut reader = Reader::<T> {
            stream: stream.try_clone().map_err(io("opening", &self.channel))?,
            channel: self.channel.clone(),
            index: self.index,
            domain: self.domain.clone(),
            sender,
        };
        let thread = std::thread::Builder::new().name(format!("{}.socket", self.channel.name));
        let reader = thread.spawn(move || reader.run()).map_err(io("reading", &self.channel))?;
        *connection = Some(Connection { stream, arrived, reader: Some(reader) });
        Ok(true)
    }

    pub(crate) fn receive(&self) -> Result<Option<OwnMessage<T>>, IpcError> {
        let connection = self.connection.borrow();
        let Some(connection) = &*connection else { return Ok(None) };
        match connection.arrived.try_recv() {
            Ok(message) => message.map(Some),
            // A producer that has sent everything is gone; what it has not sent is missed by the tick's count.
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => Ok(None),
        }
    }
}

impl<T: Message> Drop for Connection<T> {
    fn drop(&mut self) {
        // Wakes the reader, which then ends; a stream that is closed already has ended it.
        let _ = self.stream.shutdown(Shutdown::Both);
        if let Some(reader) = self.reader.take() {
            // A full queue would hold it.
            while self.arrived.recv().is_ok() {}
            let _ = reader.join();
        }
    }
}

/// Copies messages out of the socket, in a thread of its own.
struct Reader<T: Message> {
    stream: UnixStream,
    channel: Channel,
    index: usize,
    domain: crate::Domain,
    sender: SyncSender<Result<OwnMessage<T>, IpcError>>,
}

impl<T: Message> Reader<T> {
    fn run(&mut self) {
        let wake = &self.channel.consumers[self.index];
        // The node must outlive its waker.
        let opened = self
            .domain
            .node(&format!("{wake}.{}", self.channel.name))
            .and_then(|node| Waker::open(&node, wake).map(|waker| (waker, node)));
        let (waker, _node) = match opened {
            Ok(opened) => opened,
            Err(error) => {
                let _nobody_there = self.sender.send(Err(error));
                return;
            }
        };
        loop {
            let message = self.read();
            let last = message.is_err();
            let message = match message {
                // The producer, or this end, is gone.
                Err(IpcError::Io { cause, .. })
                    if matches!(cause.kind(), ErrorKind::UnexpectedEof | ErrorKind::ConnectionReset) =>
                {
                    return;
                }
                other => other,
            };
            if self.sender.send(message).is_err() {
                return;
            }
            waker.ring();
            if last {
                return;
            }
        }
    }

    fn read(&mut self) -> Result<OwnMessage<T>, IpcError> {
        let failed = io("reading", &self.channel);
        let mut envelope = [Envelope::zeroed()];
        let mut header = Box::<T::Header>::default();
        self.stream.read_exact(bytes_from_rows_mut(&mut envelope)).map_err(&failed)?;
        self.stream.read_exact(bytes_from_rows_mut(std::slice::from_mut(&mut *header))).map_err(&failed)?;
        let [envelope] = envelope;
        let len = envelope.len as usize;
        if len > T::MAX_ROWS {
            let service = self.channel.name.clone();
            return Err(IpcError::Torn { service, bytes: 0, len, row_bytes: size_of::<T::Row>() });
        }
        let mut rows = zeroed_rows(len);
        self.stream.read_exact(bytes_from_rows_mut(&mut rows)).map_err(&failed)?;
        Ok(OwnMessage { envelope, header, rows })
    }
}
