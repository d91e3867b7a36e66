//! Serves a fixed set of files to browsers on this machine: HTTP/1.1, GET and HEAD, single byte ranges, persistent connections.
//!
//! | idea | module |
//! |---|---|
//! | what is served, by name | [`Site`], [`Content`] |
//! | bytes of a request | `request`, `range` |
//! | bytes of a response | `response` |
//! | a client, and all clients | `connection`, [`Server`] |
//!
//! A name that is not in the [`Site`] does not exist: no request becomes a path of the file system. Connections, the size of a request and
//! all waits are limited. Nothing is encrypted; the server is meant for loopback.
//!
//! What it must never do: write, follow a path that a client names, listen on another interface than the caller asked for, or block the
//! program on a slow client. It knows nothing of clouds: `replica view` decides what is served.
//!
//! Where to begin reading: [`Site`] is the fixed set of names, [`Server`] accepts clients, `connection` answers the requests of one.
//!
//! `tiny_http` 0.12 has neither byte ranges nor limits of connections, so most of this would be needed beside it.

mod connection;
mod range;
mod request;
mod response;
mod server;
mod site;

pub use server::Server;
pub use site::{Content, Site, SiteError};
