"""A link that can be cut: a TCP proxy that passes bytes on, swallows them, or resets its connections."""

import contextlib
import socket
import struct
import threading
import time


class Proxy:
    """Listens at a port of its own for one robot's address. Use it in a `with` block."""

    def __init__(self, port, rate=None):
        """`port` is where to pass bytes on to, `rate` how many a second each way; None: as fast as they come."""
        self.target, self.rate = port, rate
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._lock, self._pairs, self._threads = threading.Lock(), [], []
        self._passes, self._refuses, self.over = threading.Event(), False, False
        self.passed = 0  # bytes
        self._passes.set()
        self._start(self._accept)

    @property
    def address(self):
        """For `--connect`."""
        return f"tcp/127.0.0.1:{self.port}"

    def swallow(self):
        """Let nothing through, and let nobody know: what a radio does out of range."""
        self._passes.clear()

    def reset(self):
        """Reset all connections, and each new one."""
        self._refuses = True
        self._cut()

    def heal(self):
        """Pass bytes on again; connections that were swallowed are gone, as after a long silence."""
        if not self._passes.is_set():
            self._cut()
        self._refuses = False
        self._passes.set()

    def close(self):
        """End all threads."""
        self.over = True
        self._passes.set()
        with contextlib.suppress(OSError):  # wakes the thread that accepts
            socket.create_connection(("127.0.0.1", self.port), 1).close()
        self._listener.close()
        self._cut()
        for thread in self._threads:
            thread.join(2)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _start(self, target, *arguments):
        thread = threading.Thread(target=target, args=arguments, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _cut(self):
        with self._lock:
            pairs, self._pairs = self._pairs, []
        for end in (end for pair in pairs for end in pair):
            with contextlib.suppress(OSError):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def _accept(self):
        while not self.over:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            if self._refuses or self.over:
                near.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                near.close()
                continue
            try:
                far = socket.create_connection(("127.0.0.1", self.target), 2)
            except OSError:
                near.close()
                continue
            far.settimeout(None)
            with self._lock:
                self._pairs.append((near, far))
            self._start(self._carry, near, far)
            self._start(self._carry, far, near)

    def _carry(self, source, sink):
        with contextlib.suppress(OSError):
            while not self.over:
                content = source.recv(65536 if self.rate is None else max(self.rate // 20, 1))
                if not content:
                    break
                self._passes.wait()
                sink.sendall(content)
                self.passed += len(content)
                if self.rate is not None:
                    time.sleep(len(content) / self.rate)
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
