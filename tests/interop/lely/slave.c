/* A slave on Lely core, straight from an EDS file: a drive of CiA 402, or a load-cell amplifier of CiA 404.
 *
 *     slave CHANNEL NODE-ID EDS motor|load
 *
 * SIGUSR1 makes the drive fail with overcurrent.
 */
#include <lely/can/msg.h>
#include <lely/can/net.h>
#include <lely/co/dcf.h>
#include <lely/co/dev.h>
#include <lely/co/emcy.h>
#include <lely/co/nmt.h>
#include <linux/can.h>
#include <math.h>
#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum state { DISABLED, READY, ON, ENABLED, STOPPING, FAULT };
static const int state_bits[] = {0x40, 0x21, 0x23, 0x27, 0x07, 0x08};
static const double RAMP = 20000.0; /* rpm/s */
static enum state state = DISABLED;
static int last_word, bus, master_lost;
static double speed;
static volatile sig_atomic_t fail;

static void on_signal(int number) { (void)number, fail = 1; }

static int send_frame(const struct can_msg *message, void *data) {
    struct can_frame frame = {.can_id = message->id, .can_dlc = message->len};
    (void)data;
    if (message->flags & CAN_FLAG_RTR) { frame.can_id |= CAN_RTR_FLAG; }
    memcpy(frame.data, message->data, message->len);
    for (int attempt = 0; attempt < 50; attempt++) {
        if (write(bus, &frame, sizeof frame) == sizeof frame) { return 0; }
        usleep(1000);
    }
    return -1;
}

static void on_heartbeat(co_nmt_t *nmt, co_unsigned8_t id, int what, int reason, void *data) {
    (void)data;
    master_lost = what == CO_NMT_EC_OCCURRED && reason == CO_NMT_EC_TIMEOUT;
    co_nmt_on_hb(nmt, id, what, reason);
}

static int open_bus(const char *channel) {
    struct ifreq request;
    int number = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    strncpy(request.ifr_name, channel, IFNAMSIZ - 1);
    request.ifr_name[IFNAMSIZ - 1] = 0;
    ioctl(number, SIOCGIFINDEX, &request);
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = request.ifr_ifindex};
    return bind(number, (void *)&address, sizeof address) ? -1 : number;
}

static void receive(can_net_t *net) {
    struct can_frame frame;
    while (recv(bus, &frame, sizeof frame, MSG_DONTWAIT) == sizeof frame) {
        struct can_msg message = CAN_MSG_INIT;
        struct timespec now;
        if (frame.can_id & CAN_EFF_FLAG) { continue; }
        message.id = frame.can_id & CAN_SFF_MASK;
        if (frame.can_id & CAN_RTR_FLAG) { message.flags |= CAN_FLAG_RTR; }
        message.len = frame.can_dlc;
        memcpy(message.data, frame.data, frame.can_dlc);
        clock_gettime(CLOCK_MONOTONIC, &now);
        can_net_set_time(net, &now);
        can_net_recv(net, &message);
    }
}

static void command(int word) {
    if (state == FAULT) {
        if ((word & 0x80) && !(last_word & 0x80)) { state = DISABLED; }
    } else if (!(word & 2)) {
        state = DISABLED;
    } else if (!(word & 4)) {
        state = state == ENABLED ? STOPPING : DISABLED;
    } else if ((word & 15) == 6 && state != STOPPING) {
        state = READY;
    } else if ((word & 15) == 7 && (state == READY || state == ENABLED)) {
        state = ON;
    } else if ((word & 15) == 15 && state == ON) {
        state = ENABLED;
    }
    last_word = word;
}

static void run_motor(co_dev_t *dev, co_nmt_t *nmt, double elapsed_s) {
    int word = co_dev_get_val_u16(dev, 0x6040, 0), target = co_dev_get_val_i32(dev, 0x60FF, 0);
    if (fail) {
        fail = 0, state = FAULT;
        co_dev_set_val_u16(dev, 0x603F, 0, 0x2310);
        co_emcy_push(co_nmt_get_emcy(nmt), 0x2310, 0x03, NULL);
    }
    co_dev_set_val_i8(dev, 0x6061, 0, co_dev_get_val_i8(dev, 0x6060, 0));
    if (word != last_word) { command(word); }
    if (master_lost && state == ENABLED) { state = STOPPING; }
    master_lost = 0;
    double difference = (state == ENABLED ? target : 0) - speed, step = RAMP * elapsed_s;
    speed += difference > step ? step : difference < -step ? -step : difference;
    if (state == STOPPING && fabs(speed) < 1) { state = DISABLED; }
    co_dev_set_val_i32(dev, 0x606C, 0, lround(speed));
    co_dev_set_val_i16(dev, 0x6078, 0, state == ENABLED ? 55 : 0);
    co_dev_set_val_u16(dev, 0x6041, 0, state_bits[state] | 0x200 | (fabs(speed) < 1 ? 0x1000 : 0)
                       | (state == ENABLED && fabs(speed - target) < 1 ? 0x400 : 0));
}

int main(int count, char **argument) {
    if (count != 5) { return fprintf(stderr, "usage: slave CHANNEL NODE-ID EDS motor|load\n"), 64; }
    int motor = !strcmp(argument[4], "motor");
    co_dev_t *dev = co_dev_create_from_dcf_file(argument[3]);
    can_net_t *net = can_net_create();
    struct timespec now;
    if ((bus = open_bus(argument[1])) < 0) { return perror(argument[1]), 1; }
    if (!dev) { return fprintf(stderr, "Lely cannot read %s\n", argument[3]), 2; }
    co_dev_set_id(dev, atoi(argument[2]));
    signal(SIGUSR1, on_signal);
    can_net_set_send_func(net, send_frame, 0);
    clock_gettime(CLOCK_MONOTONIC, &now);
    can_net_set_time(net, &now);
    co_nmt_t *nmt = co_nmt_create(net, dev);
    co_nmt_set_hb_ind(nmt, on_heartbeat, 0);
    co_nmt_cs_ind(nmt, CO_NMT_CS_RESET_NODE);
    for (double before = now.tv_sec + now.tv_nsec * 1e-9;;) {
        struct pollfd waiting = {bus, POLLIN, 0};
        if (poll(&waiting, 1, 10) > 0) { receive(net); }
        clock_gettime(CLOCK_MONOTONIC, &now);
        can_net_set_time(net, &now);
        double time = now.tv_sec + now.tv_nsec * 1e-9;
        if (motor) {
            run_motor(dev, nmt, time - before);
        } else {
            co_dev_set_val_i32(dev, 0x9130, 1, 4725);
            co_dev_set_val_u8(dev, 0x6150, 1, 0);
        }
        before = time;
    }
}
