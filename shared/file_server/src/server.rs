//! The server and all its clients.

use crate::connection::{self, Hosts};
use crate::response::{Refusal, refuse};
use crate::site::Site;
use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{self, Scope};
use std::time::Duration;

/// Maximum number of clients at a time. A browser opens six connections to a host.
const MAX_CONNECTIONS: usize = 64;
/// Interval at which the server checks for a new client and for its stop signal.
const POLL: Duration = Duration::from_millis(20);

/// A server bound to its address; it accepts clients while it runs.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
}

impl Server {
    /// Binds an address; with port 0 the system chooses a free one.
    pub fn bind(address: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self { address: listener.local_addr()?, listener })
    }

    /// The address on which the server listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves clients until `is_stopped`. Errors of clients end their connections only.
    pub fn run(&self, site: &Site, is_stopped: impl Fn() -> bool + Sync) {
        let hosts = if self.address.ip().is_loopback() { Hosts::Loopback } else { Hosts::Any };
        let n_connections = AtomicUsize::new(0);
        let is_stopped = &is_stopped;
        thread::scope(|scope| {
            while !is_stopped() {
                match self.listener.accept() {
                    Ok((stream, _)) => {
                        let serve = move |stream: &TcpStream| connection::serve(stream, site, hosts, is_stopped);
                        if start(scope, &n_connections, stream, serve).is_err() {
                            thread::sleep(POLL);
                        }
                    }
                    // Also happens with too many open files: some of them will be closed.
                    Err(_) => thread::sleep(POLL),
                }
            }
        });
    }
}

/// Serves a client in a thread of its own. An error, for example of a system without more threads, ends this connection.
fn start<'scope>(
    scope: &'scope Scope<'scope, '_>,
    n_connections: &'scope AtomicUsize,
    stream: TcpStream,
    serve: impl FnOnce(&TcpStream) -> io::Result<()> + Send + 'scope,
) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    if n_connections.load(Ordering::Relaxed) >= MAX_CONNECTIONS {
        // The client may have disconnected.
        let _ = refuse(&mut &stream, Refusal::TooManyConnections, true);
        return Ok(());
    }
    let place = Place::take(n_connections);
    thread::Builder::new().name("client".to_owned()).spawn_scoped(scope, move || {
        let _place = place;
        // The client has disconnected or is too slow, so the error cannot be reported to it.
        let _ = serve(&stream);
    })?;
    Ok(())
}

/// One of the connections. It is released even when a content panics.
struct Place<'a>(&'a AtomicUsize);

impl<'a> Place<'a> {
    fn take(n_connections: &'a AtomicUsize) -> Self {
        n_connections.fetch_add(1, Ordering::Relaxed);
        Self(n_connections)
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
