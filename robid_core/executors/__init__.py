"""Where parallel work is done, and with how many threads: processes of this machine, one thread each."""

from robid_core.executors.process import ProcessMap, process_executor
from robid_core.executors.threads import one_thread, thread_settings

__all__ = ["ProcessMap", "one_thread", "process_executor", "thread_settings"]
