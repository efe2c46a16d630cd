/* A slave on CANopenNode: a drive of CiA 402 (built with -DMOTOR), or a load-cell amplifier of CiA 404.
 *
 * The objects are those that object_dictionary.py adds to CANopenNode's example dictionary, named app_INDEX_SUBINDEX.
 * SIGUSR1 makes the drive fail with overcurrent.
 */
#include "CO_application.h"
#include "OD.h"
#include <math.h>
#include <signal.h>
#include <stdlib.h>

CO_ReturnError_t app_programStart(uint16_t *bit_rate, uint8_t *node_id, uint32_t *error_info) {
    (void)bit_rate, (void)node_id, (void)error_info;
    extern void app_prepare(void);
    app_prepare();
    return CO_ERROR_NO;
}
void app_communicationReset(CO_t *co) { (void)co; }
void app_programEnd(void) {}
void app_programRt(CO_t *co, uint32_t elapsed_us) { (void)co, (void)elapsed_us; }

#ifdef MOTOR
extern uint16_t app_6040_0, app_6041_0, app_603F_0;
extern int32_t app_60FF_0, app_606C_0;
extern int16_t app_6078_0;
extern int8_t app_6060_0, app_6061_0;

enum state { DISABLED, READY, ON, ENABLED, STOPPING, FAULT };
static const uint16_t state_bits[] = {0x40, 0x21, 0x23, 0x27, 0x07, 0x08};
static const double RAMP = 20000.0; /* rpm/s */
static enum state state = DISABLED;
static uint16_t last_word;
static double speed;
static int master_lost;
static volatile sig_atomic_t fail;

static void on_signal(int number) { (void)number, fail = 1; }
void app_prepare(void) { signal(SIGUSR1, on_signal); }

static void command(CO_t *co, uint16_t word) {
    if (state == FAULT) {
        if ((word & 0x80) && !(last_word & 0x80)) {
            state = DISABLED;
            CO_errorReset(co->em, CO_EM_MANUFACTURER_START, 0);
        }
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

static void watch_master(CO_t *co) {
    CO_HBconsumer_state_t heard = co->HBcons ? co->HBcons->monitoredNodes[0].HBstate : CO_HBconsumer_UNCONFIGURED;
    if (heard == CO_HBconsumer_TIMEOUT && !master_lost && state == ENABLED) { state = STOPPING; }
    master_lost = heard == CO_HBconsumer_TIMEOUT;
}

void app_programAsync(CO_t *co, uint32_t elapsed_us) {
    double step = RAMP * elapsed_us * 1e-6, goal, difference;
    if (fail) {
        fail = 0, state = FAULT, app_603F_0 = 0x2310;
        CO_errorReport(co->em, CO_EM_MANUFACTURER_START, 0x2310, 0);
    }
    app_6061_0 = app_6060_0;
    if (app_6040_0 != last_word) { command(co, app_6040_0); }
    watch_master(co);
    goal = state == ENABLED ? app_60FF_0 : 0;
    difference = goal - speed;
    speed += difference > step ? step : difference < -step ? -step : difference;
    if (state == STOPPING && fabs(speed) < 1) { state = DISABLED; }
    app_606C_0 = lround(speed);
    app_6078_0 = state == ENABLED ? 55 : 0;
    app_6041_0 = state_bits[state] | 0x200 | (fabs(speed) < 1 ? 0x1000 : 0)
                 | (state == ENABLED && fabs(speed - app_60FF_0) < 1 ? 0x400 : 0);
}
#else
extern int32_t app_9130_1;
extern uint8_t app_6150_1;
void app_prepare(void) {}
void app_programAsync(CO_t *co, uint32_t elapsed_us) {
    (void)co, (void)elapsed_us;
    app_9130_1 = 4725, app_6150_1 = 0;
}
#endif
