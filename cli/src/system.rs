//! What the machine has: memory, cores, threads on them, a name; and the user's wish to stop.

use sysinfo::{MemoryRefreshKind, ProcessRefreshKind, ProcessesToUpdate, RefreshKind, System};

use crate::error::{Error, Result};

/// Memory that a job may take, bytes: what is available, within the limits of a container.
pub(crate) fn memory() -> u64 {
    let memory = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    // A system that does not tell gets the benefit of the doubt.
    let Ok(system) = System::new_with_specifics(memory) else {
        return u64::MAX;
    };
    let limit = system.cgroup_limits().map_or(u64::MAX, |l| l.free_memory);
    system.available_memory().min(limit)
}

/// Memory that this process holds, bytes; 0 on a system that does not tell.
pub(crate) fn memory_held() -> u64 {
    let (Ok(mut system), Ok(me)) = (System::new(), sysinfo::get_current_pid()) else {
        return 0;
    };
    let memory = ProcessRefreshKind::nothing().with_memory();
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&[me]), false, memory);
    system.process(me).map_or(0, sysinfo::Process::memory)
}

/// Cores of this machine that this process may use.
pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// Threads of this process's own to compute on.
pub(crate) fn pool(threads: usize) -> Result<rayon::ThreadPool> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| Error::Threads(e.to_string()))
}

/// Threads of all programs that wanted a core in the last minute, on average; 0 where nobody counts.
pub(crate) fn load() -> f64 {
    System::load_average().map_or(0.0, |load| load.one)
}

/// CPU time that each of these processes has taken so far, s; 0 for one that is not there, and where
/// the system does not tell.
pub(crate) fn cpu_seconds(processes: &[u32]) -> Vec<f64> {
    processes
        .iter()
        .map(|&p| cpu_of(p).unwrap_or(0.0))
        .collect()
}

#[cfg(target_os = "linux")]
fn cpu_of(process: u32) -> Option<f64> {
    let pid = nix::unistd::Pid::from_raw(i32::try_from(process).ok()?);
    let taken = nix::time::clock_getcpuclockid(pid).ok()?.now().ok()?;
    Some(std::time::Duration::from(taken).as_secs_f64())
}

#[cfg(not(target_os = "linux"))]
fn cpu_of(_process: u32) -> Option<f64> {
    None
}

/// Asks a process of ours to come to an end in good order; where that cannot be asked, ends it.
pub(crate) fn ask_to_stop(child: &mut tokio::process::Child) {
    #[cfg(target_os = "linux")]
    if let Some(pid) = child.id().and_then(|id| i32::try_from(id).ok()) {
        use nix::sys::signal::{Signal, kill};
        // It may have ended by itself.
        let _ = kill(nix::unistd::Pid::from_raw(pid), Signal::SIGTERM);
    }
    #[cfg(not(target_os = "linux"))]
    let _ = child.start_kill();
}

/// Addresses of this host that others may reach, each with its interface; none where the system does
/// not tell.
pub(crate) fn addresses() -> Vec<String> {
    #[cfg(target_os = "linux")]
    if let Ok(all) = nix::ifaddrs::getifaddrs() {
        let named = all.filter_map(|one| {
            let address = one.address?;
            let v4 = address
                .as_sockaddr_in()
                .map(|a| std::net::IpAddr::V4(a.ip()));
            let v6 = address
                .as_sockaddr_in6()
                .map(|a| std::net::IpAddr::V6(a.ip()));
            let ip = v4.or(v6).filter(|ip| !ip.is_loopback())?;
            Some(format!("{ip} ({})", one.interface_name))
        });
        return named.collect();
    }
    Vec::new()
}

/// How many files this process may have open; nothing where the system does not tell.
pub(crate) fn open_files() -> Option<u64> {
    #[cfg(target_os = "linux")]
    {
        use nix::sys::resource::{Resource, getrlimit};
        getrlimit(Resource::RLIMIT_NOFILE)
            .ok()
            .map(|(soft, _)| soft)
    }
    #[cfg(not(target_os = "linux"))]
    None
}

/// This host's name.
pub(crate) fn host_name() -> String {
    System::host_name().unwrap_or_else(|_| "localhost".to_owned())
}

/// Returns when the user, or the system on somebody's behalf, asks to stop.
pub(crate) async fn interrupted() {
    let interrupt = async {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    #[cfg(unix)]
    let terminate = async {
        use tokio::signal::unix::{SignalKind, signal};
        match signal(SignalKind::terminate()) {
            Ok(mut signal) => drop(signal.recv().await),
            Err(_) => std::future::pending().await,
        }
    };
    #[cfg(not(unix))]
    let terminate = std::future::pending::<()>();
    tokio::select! {
        () = interrupt => {}
        () = terminate => {}
    }
}
