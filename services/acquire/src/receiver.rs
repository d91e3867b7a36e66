//! The thread that receives: from the sockets into the capture, and nothing else.
//!
//! It waits for nobody but the sensor and the disk's cache. Whoever decodes reads the capture behind it.

use crate::drops::dropped;
use formats::pcap::{Frontier, Recorder};
use geometry::Stamp;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::sockopt::{set_socket_recv_buffer_size, set_socket_recv_buffer_size_force, socket_recv_buffer_size};
use std::io;
use std::net::{SocketAddr, SocketAddrV4, UdpSocket};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// What the kernel is asked to hold while the disk stalls: some four seconds of an HDL-32E.
const BUFFER: usize = 8 << 20;
/// Packets are in the file, for the decoder and for a crash, after this long. Less would only cost system calls.
const FLUSH: Duration = Duration::from_millis(5);
/// How soon the thread sees that it is to stop.
const IDLE: Duration = Duration::from_millis(50);
/// Packets taken from one socket before the other has its turn.
const BURST: usize = 64;
/// Packets that a full buffer of [`BUFFER`] may hold, and reserve: at the end no more are taken, however fast the sensor sends.
const MAX_HELD: usize = 16_384;
/// The largest UDP packet.
const MAX_PACKET: usize = 65_536;

/// The bound sockets of a sensor.
#[derive(Debug)]
pub(crate) struct Sockets([(UdpSocket, SocketAddrV4); 2]);

impl Sockets {
    /// Binds data and position socket.
    pub(crate) fn bind(addresses: [SocketAddrV4; 2]) -> Result<Self, String> {
        let [data, position] = addresses;
        Ok(Self([bind(data)?, bind(position)?]))
    }

    /// Bytes that the kernel holds of the data socket; its bookkeeping counts too.
    pub(crate) fn buffer_bytes(&self) -> usize {
        socket_recv_buffer_size(&self.0[0].0).unwrap_or_default()
    }
}

/// Binds a socket that does not block.
pub(crate) fn bind(address: SocketAddrV4) -> Result<(UdpSocket, SocketAddrV4), String> {
    let bound = || -> io::Result<(UdpSocket, SocketAddrV4)> {
        let socket = UdpSocket::bind(address)?;
        socket.set_nonblocking(true)?;
        // The first needs a privilege, the second is held to net.core.rmem_max; with less the sensor is still received.
        if set_socket_recv_buffer_size_force(&socket, BUFFER).is_err() {
            let _ = set_socket_recv_buffer_size(&socket, BUFFER);
        }
        Ok((socket, address))
    };
    bound().map_err(|error| format!("{address} cannot be bound: {error}"))
}

/// The thread and what it has to say.
pub(crate) struct Receiver {
    /// None after the end.
    sockets: Option<Arc<Sockets>>,
    frontier: Frontier,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    /// What the kernel had dropped at the last look, and what of that has been told.
    n_dropped: u64,
    n_dropped_told: u64,
}

#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    n_packets: AtomicU64,
    silent_millis: AtomicU64,
    fault: Mutex<Option<String>>,
    /// Rung when there is more in the file. The thread never takes the lock, so a ring may be missed; waits are short.
    bell: Condvar,
    bell_lock: Mutex<()>,
}

impl Receiver {
    /// Begins to receive.
    pub(crate) fn start(sockets: Sockets, recorder: Recorder) -> io::Result<Self> {
        let (sockets, shared, frontier) = (Arc::new(sockets), Arc::new(Shared::default()), recorder.frontier());
        let thread = std::thread::Builder::new().name("receiver".to_owned());
        let (of_thread, sockets_of_thread) = (Arc::clone(&shared), Arc::clone(&sockets));
        let thread = thread.spawn(move || {
            if let Err(error) = receive(&sockets_of_thread, recorder, &of_thread) {
                *of_thread.fault.lock().unwrap_or_else(PoisonError::into_inner) = Some(error.to_string());
            }
            of_thread.bell.notify_all();
        })?;
        Ok(Self { sockets: Some(sockets), frontier, shared, thread: Some(thread), n_dropped: 0, n_dropped_told: 0 })
    }

    /// Bytes that the kernel holds of packets that nobody has taken.
    pub(crate) fn buffer_bytes(&self) -> usize {
        self.sockets.as_ref().map_or(0, |sockets| sockets.buffer_bytes())
    }

    /// How far the capture can be read.
    pub(crate) fn frontier(&self) -> &Frontier {
        &self.frontier
    }

    /// Packets received so far, of whomever.
    pub(crate) fn n_packets(&self) -> u64 {
        self.shared.n_packets.load(Ordering::Relaxed)
    }

    /// Why the thread has ended, if nobody asked it to.
    pub(crate) fn fault(&self) -> Option<String> {
        let has_ended = self.thread.as_ref().is_some_and(JoinHandle::is_finished);
        let text = self.shared.fault.lock().unwrap_or_else(PoisonError::into_inner).clone();
        has_ended.then(|| text.unwrap_or_else(|| "the receiving thread has panicked".to_owned()))
    }

    /// For how long there has been nothing to receive, s; 0 before the first packet. A thread that waits for the disk does not
    /// know, and so says nothing new.
    pub(crate) fn silent_s(&self) -> f64 {
        self.shared.silent_millis.load(Ordering::Relaxed) as f64 * 1e-3
    }

    /// Packets lost by the kernel since the last call.
    pub(crate) fn take_dropped(&mut self) -> u64 {
        self.look_for_drops();
        let before = std::mem::replace(&mut self.n_dropped_told, self.n_dropped);
        self.n_dropped.saturating_sub(before)
    }

    fn look_for_drops(&mut self) {
        if let Some(sockets) = &self.sockets {
            self.n_dropped = sockets.0.iter().filter_map(|(socket, _)| dropped(socket)).sum();
        }
    }

    /// Waits for more in the file, a little while. `false` once it is `until`.
    pub(crate) fn wait(&self, until: Instant) -> bool {
        let left = until.saturating_duration_since(Instant::now()).min(2 * FLUSH);
        if left.is_zero() {
            return false;
        }
        let lock = self.shared.bell_lock.lock().unwrap_or_else(PoisonError::into_inner);
        drop(self.shared.bell.wait_timeout(lock, left));
        true
    }

    /// Ends the thread, which takes what the kernel still holds; the capture is complete after it.
    pub(crate) fn close(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // Its panic has been told on stderr.
            let _ = thread.join();
        }
        self.look_for_drops();
        self.sockets = None;
    }
}

impl Drop for Receiver {
    fn drop(&mut self) {
        self.close();
    }
}

fn receive(sockets: &Sockets, mut recorder: Recorder, shared: &Shared) -> io::Result<()> {
    let mut packet = vec![0; MAX_PACKET];
    let mut flushed = Instant::now();
    let mut heard = None;
    while !shared.stop.load(Ordering::Relaxed) {
        let patience = if recorder.has_unwritten() { FLUSH } else { IDLE };
        let mut n_packets = 0;
        for (is_ready, (socket, address)) in wait_for_packets(sockets, patience)?.into_iter().zip(&sockets.0) {
            if is_ready {
                n_packets += take_burst(socket, *address, BURST, &mut packet, &mut recorder)?;
            }
        }
        shared.n_packets.fetch_add(n_packets, Ordering::Relaxed);
        if n_packets > 0 {
            heard = Some(Instant::now());
        }
        let silent = heard.map_or(Duration::ZERO, |heard| heard.elapsed());
        shared.silent_millis.store(silent.as_millis() as u64, Ordering::Relaxed);
        if recorder.has_unwritten() && flushed.elapsed() >= FLUSH {
            recorder.flush()?;
            flushed = Instant::now();
            shared.bell.notify_all();
        }
    }
    for (socket, address) in &sockets.0 {
        let n_packets = take_burst(socket, *address, MAX_HELD, &mut packet, &mut recorder)?;
        shared.n_packets.fetch_add(n_packets, Ordering::Relaxed);
    }
    recorder.flush()
}

/// Which sockets have something.
fn wait_for_packets(sockets: &Sockets, patience: Duration) -> io::Result<[bool; 2]> {
    let [(data, _), (position, _)] = &sockets.0;
    let mut descriptors = [PollFd::new(data, PollFlags::IN), PollFd::new(position, PollFlags::IN)];
    let timeout = Timespec { tv_sec: 0, tv_nsec: i64::from(patience.subsec_nanos()) };
    match poll(&mut descriptors, Some(&timeout)) {
        Ok(_) => Ok(descriptors.map(|descriptor| !descriptor.revents().is_empty())),
        Err(rustix::io::Errno::INTR) => Ok([false; 2]),
        Err(error) => Err(error.into()),
    }
}

/// Takes what is there, up to so many packets, and says how many that were.
fn take_burst(
    socket: &UdpSocket,
    address: SocketAddrV4,
    limit: usize,
    packet: &mut [u8],
    recorder: &mut Recorder,
) -> io::Result<u64> {
    for n in 0..limit {
        match socket.recv_from(packet) {
            Ok((length, SocketAddr::V4(source))) => recorder.write(now(), source, address, &packet[..length])?,
            // An IPv4 socket has no other senders.
            Ok((_, SocketAddr::V6(_))) => {}
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(n as u64),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(limit as u64)
}

/// The wall clock: captures carry its stamps, and so tell the hour that the sensor does not.
fn now() -> Stamp {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    Stamp(since.as_nanos() as i64)
}
