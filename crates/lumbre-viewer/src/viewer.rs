//! A viewer: a scene, the threads that render it, and the server that shows it.

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;

use tokio::sync::Notify;

use crate::guard::Guard;
use crate::server::{self, Server, listen};
use crate::session::Session;
use crate::source::Source;
use crate::worker::Worker;

/// The address of a viewer.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Options {
    /// Where it listens; port 0 for any free port. Anyone who reaches an address other than the local one can load its
    /// page, but sees nothing without the token.
    pub address: SocketAddr,
    /// Other names under which browsers reach it, as `name:port`: those of a tunnel whose ends have different ports.
    pub hosts: Vec<String>,
    /// A file, in a folder of the user's own, that keeps the session: open pages continue when another viewer starts at
    /// the same address. Without it, the new viewer's address must be opened.
    pub session_file: Option<PathBuf>,
}

impl Default for Options {
    /// This machine only, at any port.
    fn default() -> Self {
        Self { address: (Ipv4Addr::LOCALHOST, 0).into(), hosts: Vec::new(), session_file: None }
    }
}

/// A viewer that is ready to run.
pub struct Viewer {
    server: Arc<Server>,
    listener: TcpListener,
    address: SocketAddr,
}

impl std::fmt::Debug for Viewer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Viewer").field("address", &self.address).finish_non_exhaustive()
    }
}

/// Closes a viewer, from any thread.
#[derive(Clone)]
pub struct Closer {
    server: Arc<Server>,
}

impl std::fmt::Debug for Closer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Closer").finish_non_exhaustive()
    }
}

impl Closer {
    /// Closes it: [`Viewer::run`] returns soon.
    pub fn close(&self) {
        self.server.session.close();
        self.server.closed.notify_one();
    }
}

impl Viewer {
    /// Takes the address.
    ///
    /// # Errors
    /// Why it is not available.
    pub fn new(source: Arc<dyn Source>, options: &Options) -> Result<Self, String> {
        let listener = listen(options.address)?;
        let address = listener.local_addr().map_err(|e| e.to_string())?;
        let guard = Guard::new(address, &options.hosts, options.session_file.as_deref())?;
        let dropped = tempfile::tempdir().map_err(|e| format!("cannot make a temporary folder: {e}"))?;
        let session = Arc::new(Session::new(source));
        let server = Arc::new(Server {
            session,
            guard,
            dropped,
            visitors: Arc::default(),
            closed: Arc::new(Notify::new()),
        });
        Ok(Self { server, listener, address })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The address to open in a browser. It works once.
    pub fn url(&self) -> String {
        format!("http://{}{}", self.address, self.server.guard.path())
    }

    /// A handle that closes it.
    pub fn closer(&self) -> Closer {
        Closer { server: self.server.clone() }
    }

    /// Renders and answers until it is closed.
    ///
    /// # Errors
    /// Failures of the system.
    pub fn run(self) -> Result<(), String> {
        let Self { server, listener, .. } = self;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|e| e.to_string())?;
        let session = server.session.clone();
        let work = Worker::new(session.clone());
        let named = |name: &str| std::thread::Builder::new().name(name.to_owned());
        let worker = named("worker").spawn(move || work.run()).map_err(|e| e.to_string())?;
        let watched = session.clone();
        let watcher = named("watcher").spawn(move || watched.watch()).map_err(|e| e.to_string())?;
        let served = runtime.block_on(server::serve(server, listener)).map_err(|e| e.to_string());
        session.close();
        // Remaining tasks end with the runtime.
        runtime.shutdown_background();
        let ended = [worker.join(), watcher.join()];
        served?;
        if ended.iter().any(Result::is_err) {
            Err("a thread of the viewer has failed".to_owned())
        } else {
            Ok(())
        }
    }
}
