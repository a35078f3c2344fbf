//! The threads of a render.

use rayon::prelude::*;

/// The requested threads, or as many as the system grants.
pub(crate) struct Workers {
    /// `None` if it grants none: the calling thread does the work.
    pool: Option<rayon::ThreadPool>,
    refused: usize,
}

impl Workers {
    /// This many threads; 0 for one per core.
    pub(crate) fn start(threads: usize) -> Self {
        let wanted = Self::wanted(threads);
        // The first try lets rayon read its environment variables, too.
        let mut count = threads;
        loop {
            match rayon::ThreadPoolBuilder::new().num_threads(count).build() {
                Ok(pool) if count == threads => return Self { pool: Some(pool), refused: 0 },
                Ok(pool) => return Self { pool: Some(pool), refused: wanted.saturating_sub(count) },
                Err(_) => count = if count == 0 { wanted / 2 } else { count / 2 },
            }
            if count == 0 {
                return Self { pool: None, refused: wanted - 1 };
            }
        }
    }

    /// The requested number; 0 is one per core.
    pub(crate) fn wanted(threads: usize) -> usize {
        match threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            threads => threads,
        }
    }

    /// Number of threads.
    pub(crate) fn count(&self) -> usize {
        self.pool.as_ref().map_or(1, rayon::ThreadPool::current_num_threads)
    }

    /// Number of threads that the system refused.
    pub(crate) fn refused(&self) -> usize {
        self.refused
    }

    /// Does work for each item, in parallel.
    pub(crate) fn for_each<T: Send>(&self, items: &mut [T], work: impl Fn(&mut T) + Send + Sync) {
        match &self.pool {
            Some(pool) => pool.install(|| items.par_iter_mut().for_each(work)),
            None => items.iter_mut().for_each(work),
        }
    }
}
