#!/bin/busybox sh
# The guest's first process. When it fails, the kernel panics and QEMU ends: no status, no success.
set -e
b=/bin/busybox

$b mount -t proc proc /proc
$b mount -t sysfs sys /sys
$b mount -t devtmpfs dev /dev
for module in /modules/*; do $b insmod "$module"; done

# Mounts the host's files for reading; written files stay in memory. A file that was read also stays in memory
# (cache=loose), because waiting for the host makes the guest's clock jump. The guest may miss later changes on the host.
virtio=trans=virtio,version=9p2000.L,msize=524288
$b mount -t 9p -o ro,cache=loose,$virtio host /host
$b mount -t tmpfs -o mode=755,size=75% layer /layer
$b mkdir /layer/files /layer/work
$b mount -t overlay -o lowerdir=/host,upperdir=/layer/files,workdir=/layer/work machine /machine

$b mount -t 9p -o $virtio exchange /exchange
if [ -e /exchange/results ]; then
    $b mount -t 9p -o $virtio results "/machine$($b cat /exchange/results)"
fi

for folder in proc sys dev; do $b mount -o move /$folder /machine/$folder; done
$b mkdir -p /machine/dev/pts /machine/dev/shm
$b mount -t devpts -o ptmxmode=666 devpts /machine/dev/pts
$b mount -t tmpfs -o mode=1777 shm /machine/dev/shm

export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
inside() { $b chroot /machine "$@"; }
inside ip link set lo up
for name in vcan0 vcan1 vcan2; do
    inside ip link add dev $name type vcan
    inside ip link set $name up
done

# Prints the clock, so that the last console lines show whether this machine or a program in it has stopped.
while $b sleep 30; do echo "clock of the virtual machine: $($b cut -d ' ' -f 1 /proc/uptime) s"; done > /dev/console &

# The port is no terminal: bytes go out as they are.
port=/machine/dev/$($b basename /machine/sys/class/virtio-ports/*)
code=0
inside /bin/sh -c "$($b cat /exchange/command)" < /machine/dev/null > "$port" 2>&1 || code=$?

# The name comes last, so that half a status is none.
echo $code > /exchange/status.part
$b mv /exchange/status.part /exchange/status
$b poweroff -f
