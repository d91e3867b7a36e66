//! Messages through sockets, for the benchmark of what copying costs: each message is written into a Unix stream socket to
//! each consumer and read into memory of the consumer.
//!
//! On the socket, the consumer first sends its index and the type that it expects ([`HELLO_BYTES`]). Then the producer
//! sends messages:
//!
//! | bytes | content |
//! |---|---|
//! | 0 .. 64 | [`Envelope`] |
//! | 64 .. | `T::Header` |
//! | next .. | the rows, without gaps |
//!
//! A thread of the consumer reads them, at most a queue's length ahead of the stage, so that a producer never waits for
//! a consumer that waits for another of its topics. Credits, acknowledgements and wakes are the same as in shared memory.

use crate::message_type::MessageType;
use crate::own_memory::AnyOwnMessage;
use crate::slot::Slot;
use crate::transport::{Arrived, Incoming, Outgoing, Written};
use crate::{Channel, IpcError, Node};
use messages::Envelope;
use messages::pod::bytes_from_rows_mut;
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
    node.domain.root().join(format!("{}.socket", channel.name))
}

fn io(what: &str, channel: &Channel) -> impl Fn(std::io::Error) -> IpcError {
    let what = format!("{what} the socket of {}", channel.name);
    move |cause| IpcError::Io { what: what.clone(), cause }
}

/// The producing end.
pub(crate) struct SocketOutgoing {
    channel: Channel,
    path: PathBuf,
    listener: UnixListener,
    consumers: RefCell<Vec<Option<UnixStream>>>,
}

impl SocketOutgoing {
    pub(crate) fn open(node: &Node, channel: &Channel) -> Result<Self, IpcError> {
        let path = socket_path(node, channel);
        let listener = UnixListener::bind(&path).map_err(io("binding", channel))?;
        listener.set_nonblocking(true).map_err(io("opening", channel))?;
        let consumers = RefCell::new(channel.consumers.iter().map(|_| None).collect());
        Ok(Self { channel: channel.clone(), path, listener, consumers })
    }

    fn admit(&self, mut stream: UnixStream) -> Result<(), IpcError> {
        let mut received = [0; HELLO_BYTES];
        stream.set_nonblocking(false).map_err(io("opening", &self.channel))?;
        stream.read_exact(&mut received).map_err(io("reading", &self.channel))?;
        let index = u32::from_le_bytes([received[0], received[1], received[2], received[3]]);
        let mut consumers = self.consumers.borrow_mut();
        match consumers.get_mut(index as usize) {
            Some(place) if received == hello(&self.channel, index) => {
                *place = Some(stream);
                Ok(())
            }
            _ => {
                let what = format!("consumer {index} of {}", self.channel.name);
                Err(IpcError::transport(what, "unknown consumer, or it expects another version or layout"))
            }
        }
    }
}

impl Outgoing for SocketOutgoing {
    fn connect(&self) -> Result<bool, IpcError> {
        loop {
            match self.listener.accept() {
                Ok((stream, _)) => self.admit(stream)?,
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) => return Err(io("accepting on", &self.channel)(error)),
            }
        }
        Ok(self.consumers.borrow().iter().all(Option::is_some))
    }

    fn slot(&self, _capacity: usize) -> Result<Option<Slot>, IpcError> {
        Ok(None)
    }

    fn send(&self, message: Written<'_>, envelope: &Envelope) -> Result<usize, IpcError> {
        let Written::Parts(parts) = message else { return Err(self.channel.foreign_loan(envelope.seq)) };
        let mut consumers = self.consumers.borrow_mut();
        Ok(consumers.iter_mut().flatten().filter_map(|stream| write_all(stream, parts).ok()).count())
    }

    fn needs_notification(&self) -> bool {
        false
    }
}

impl Drop for SocketOutgoing {
    fn drop(&mut self) {
        // The supervisor removes the folder in any case.
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
pub(crate) struct SocketIncoming {
    channel: Channel,
    message: MessageType,
    path: PathBuf,
    index: usize,
    domain: crate::Domain,
    connection: RefCell<Option<Connection>>,
}

struct Connection {
    stream: UnixStream,
    arrived: Receiver<Result<Box<dyn AnyOwnMessage>, IpcError>>,
    reader: Option<JoinHandle<()>>,
}

impl SocketIncoming {
    pub(crate) fn new(node: &Node, channel: &Channel, message: MessageType, index: usize) -> Self {
        let path = socket_path(node, channel);
        Self {
            channel: channel.clone(),
            message,
            path,
            index,
            domain: node.domain.clone(),
            connection: RefCell::new(None),
        }
    }
}

impl Incoming for SocketIncoming {
    fn connect(&self) -> Result<bool, IpcError> {
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
        let mut reader = Reader {
            stream: stream.try_clone().map_err(io("opening", &self.channel))?,
            channel: self.channel.clone(),
            message: self.message,
            index: self.index,
            domain: self.domain.clone(),
            sender,
        };
        let thread = std::thread::Builder::new().name(format!("{}.socket", self.channel.name));
        let reader = thread.spawn(move || reader.run()).map_err(io("reading", &self.channel))?;
        *connection = Some(Connection { stream, arrived, reader: Some(reader) });
        Ok(true)
    }

    fn receive(&self) -> Result<Option<Arrived>, IpcError> {
        let connection = self.connection.borrow();
        let Some(connection) = &*connection else { return Ok(None) };
        match connection.arrived.try_recv() {
            Ok(message) => message.map(|message| Some(Arrived::Own(message))),
            // The producer has sent everything and ended; a message that it did not send is missing in the tick's count.
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => Ok(None),
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        // Ends the reader; if the stream is closed already, it has ended.
        let _ = self.stream.shutdown(Shutdown::Both);
        if let Some(reader) = self.reader.take() {
            // A full queue would block it.
            while self.arrived.recv().is_ok() {}
            let _ = reader.join();
        }
    }
}

/// Copies messages out of the socket, in a thread of its own.
struct Reader {
    stream: UnixStream,
    channel: Channel,
    message: MessageType,
    index: usize,
    domain: crate::Domain,
    sender: SyncSender<Result<Box<dyn AnyOwnMessage>, IpcError>>,
}

impl Reader {
    fn run(&mut self) {
        let wake = &self.channel.consumers[self.index];
        // The node must outlive its waker.
        let opened = self
            .domain
            .node(&format!("{wake}.{}", self.channel.name))
            .and_then(|node| node.open_waker(wake).map(|waker| (waker, node)));
        let (waker, _node) = match opened {
            Ok(opened) => opened,
            Err(error) => {
                let _receiver_gone = self.sender.send(Err(error));
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
            waker.wake();
            if last {
                return;
            }
        }
    }

    fn read(&mut self) -> Result<Box<dyn AnyOwnMessage>, IpcError> {
        let failed = io("reading", &self.channel);
        let mut envelope = [Envelope::default()];
        self.stream.read_exact(bytes_from_rows_mut(&mut envelope)).map_err(&failed)?;
        let [envelope] = envelope;
        let len = envelope.len as usize;
        if len > self.message.max_rows {
            let service = self.channel.name.clone();
            return Err(IpcError::Torn { service, bytes: 0, len, row_bytes: self.message.row_bytes });
        }
        let mut message = (self.message.zeroed)(envelope);
        for bytes in message.bytes_mut() {
            self.stream.read_exact(bytes).map_err(&failed)?;
        }
        Ok(message)
    }
}
